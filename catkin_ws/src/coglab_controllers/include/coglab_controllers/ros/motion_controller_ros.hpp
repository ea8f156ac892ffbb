/// @file
/// The ROS side of a motion controller plug-in: its services and topics, below its id.
#pragma once

#include <ros/console.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>

#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

using coglab_rt::ageOf;
using coglab_rt::nanoseconds;
using coglab_rt::toRos;
using coglab_rt::toSteady;

/// Level at which the early end of a motion is logged: one that was asked for is no warning.
inline ros::console::Level endLevel(const Reason& why) {
  const ReasonCode code = why.code();
  const bool asked = code == ReasonCode::Cancelled || code == ReasonCode::Switched ||
                     code == ReasonCode::Superseded;
  return asked ? ros::console::levels::Info : ros::console::levels::Warn;
}

/// What every ROS side shares.
struct RosContext {
  tf2_ros::Buffer* tf = nullptr;         ///< outlives the ROS sides
  const TfListener* listener = nullptr;  ///< fills the buffer
};

/// Made by the plug-in's library beside the controller
/// (COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS).
class MotionControllerRos {
 public:
  virtual ~MotionControllerRos() = default;

  /// Advertises and subscribes below `node` (…/controller_manager/<id>). The controller outlives
  /// this object, whose destructor ends its services and subscriptions.
  virtual void attach(MotionController& controller, const ros::NodeHandle& node,
                      const RosContext& context) = 0;

  /// Called by the goal thread, 200 times a second: frames to mailboxes. A motion depends on it, so
  /// it waits for nothing: it publishes nothing, logs nothing and never asks the ROS master.
  virtual void pollGoal() {}

  /// Called by the publisher thread, 200 times a second: queues and mailboxes to topics. It never
  /// asks the ROS master, which may not answer: parameters come from getParamCached().
  virtual void spinOnce() = 0;
};

}  // namespace coglab_controllers
