/// @file
/// The gains of the feedback controllers for dynamic_reconfigure.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/ros/reconfigure_server.hpp"

namespace coglab_controllers {

/// A ReconfigureServer for each feedback controller that has gains, below its name. A gain of
/// several numbers is shown as `gain_0`, `gain_1`, and so on. Changes are blended in, as by
/// set_gains.
class FeedbackReconfigure {
 public:
  FeedbackReconfigure(const ros::NodeHandle& node, ControllerManager& manager);

  /// Starts and ends servers, so that each loaded controller has one, and publishes the gains. Call
  /// it after each load, unload and change of gains. It calls the ROS master.
  void refresh();

 private:
  ros::NodeHandle node_;
  ControllerManager& manager_;
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<ReconfigureServer>> servers_;
};

}  // namespace coglab_controllers
