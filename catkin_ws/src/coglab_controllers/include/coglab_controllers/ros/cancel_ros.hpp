/// @file
/// The services that end motions.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_msgs/CancelMotion.h"

namespace coglab_controllers {

/// Service `<id>/cancel` of every loaded motion controller. Separate threads serve it, so that
/// requests that wait for the cycle or for a library do not delay a cancel.
class CancelRos {
 public:
  /// @param node namespace of the manager  @param manager outlives this object
  CancelRos(const ros::NodeHandle& node, ControllerManager& manager);
  ~CancelRos();
  CancelRos(const CancelRos&) = delete;
  CancelRos& operator=(const CancelRos&) = delete;

  /// Advertises the service of a motion controller. Any thread.
  void serve(const std::string& id);
  /// Removes the service after the running calls have ended.
  void withdraw(const std::string& id);

 private:
  ros::NodeHandle node_;
  ControllerManager& manager_;
  ros::CallbackQueue queue_;
  std::mutex services_mutex_;
  std::map<std::string, ros::ServiceServer> services_;  // by id
  ros::AsyncSpinner spinner_;
};

}  // namespace coglab_controllers
