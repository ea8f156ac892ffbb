/// @file
/// Ctrl-MORE's feedback controllers on ROS: services below controller_manager/feedback, and their
/// log.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/ros/feedback_reconfigure.hpp"
#include "coglab_msgs/DescribeController.h"
#include "coglab_msgs/FeedbackBySignal.h"
#include "coglab_msgs/FeedbackSelect.h"
#include "coglab_msgs/FeedbackState.h"
#include "coglab_msgs/FeedbackStatus.h"
#include "coglab_msgs/LoadFeedback.h"
#include "coglab_msgs/ReloadGains.h"
#include "coglab_msgs/SetExecutionOrder.h"
#include "coglab_msgs/SetGains.h"
#include "ctrl_more/log/logger.hpp"

namespace coglab_controllers {

/// Writes records of Ctrl-MORE's logger to rosconsole, with controller, source location and cycle.
class RosLogSink : public ctrl_more::LogSink {
 public:
  void write(const ctrl_more::LogRecord& record) override;
};

/// Services: enable, disable, pause, resume, set_execution_order, pause_by_signal,
/// resume_by_signal, disable_by_signal, reload_gains, set_gains, describe, load, unload (names: one
/// controller), apply_profile (names: one profile). Topics: status (latched), and state with the
/// internal values of each controller and its change of each reference. Every service answers after
/// the cycle has adopted the change. The gains are also on dynamic_reconfigure
/// (feedback_reconfigure).
class FeedbackRos {
 public:
  FeedbackRos(const ros::NodeHandle& node, ControllerManager& manager);
  ~FeedbackRos();

  /// Call it after a feedback controller was loaded or unloaded without these services.
  void refreshGains() { reconfigure_.refresh(); }

  /// Publishes status if it changed, and state while it has a subscriber. Publisher thread.
  void publishStatus();

 private:
  using Select = coglab_msgs::FeedbackSelect;
  using BySignal = coglab_msgs::FeedbackBySignal;

  template <ctrl_more::Change::Kind kind>
  bool onSelect(Select::Request& request, Select::Response& response);
  template <ctrl_more::Change::Kind kind>
  bool onSignal(BySignal::Request& request, BySignal::Response& response);
  bool onProfile(Select::Request& request, Select::Response& response);
  bool onOrder(coglab_msgs::SetExecutionOrder::Request& request,
               coglab_msgs::SetExecutionOrder::Response& response);
  bool onReload(coglab_msgs::ReloadGains::Request& request,
                coglab_msgs::ReloadGains::Response& response);
  bool onDescribe(coglab_msgs::DescribeController::Request& request,
                  coglab_msgs::DescribeController::Response& response);
  bool onSetGains(coglab_msgs::SetGains::Request& request,
                  coglab_msgs::SetGains::Response& response);
  bool onLoad(coglab_msgs::LoadFeedback::Request& request,
              coglab_msgs::LoadFeedback::Response& response);
  bool onUnload(Select::Request& request, Select::Response& response);
  void publishState();
  template <typename Response>
  bool finish(const ctrl_more::Status& status, Response& response);

  ros::NodeHandle node_;
  ControllerManager& manager_;
  ctrl_more::FeedbackControllersManager& feedback_;
  ros::Publisher status_, state_;
  std::vector<ros::ServiceServer> services_;
  FeedbackReconfigure reconfigure_;
  coglab_msgs::FeedbackStatus last_;
  bool published_ = false;
};

}  // namespace coglab_controllers
