/// @file
/// ROS side of a motion controller plug-in: its services and topics below its id.
#pragma once

#include <functional>
#include <string>

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

/// Log level of the early end of a motion: Info if it was requested, else Warn.
inline ros::console::Level endLevel(const Reason& why) {
  const ReasonCode code = why.code();
  const bool asked = code == ReasonCode::Cancelled || code == ReasonCode::Switched ||
                     code == ReasonCode::Superseded;
  return asked ? ros::console::levels::Info : ros::console::levels::Warn;
}

/// Objects that all ROS sides share.
struct RosContext {
  tf2_ros::Buffer* tf = nullptr;         ///< outlives the ROS sides
  const TfListener* listener = nullptr;  ///< fills the buffer
  /// Makes this controller the active one; refused while a motion of another one moves the arm. Not
  /// from the publisher's or the goal thread, because it waits for the cycle.
  std::function<Answer()> take_arm;
  /// Ends this controller's motion with the next cycle. Does not wait.
  /// @param why who or what ends it, for the log
  std::function<void(const std::string& why)> cancel;
};

/// Base class of ROS sides. The plug-in's library makes one with each controller
/// (COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS).
class MotionControllerRos {
 public:
  virtual ~MotionControllerRos() = default;

  /// Advertises and subscribes below `node` (…/controller_manager/<id>). The controller outlives
  /// this object, whose destructor ends its services and subscriptions.
  virtual void attach(MotionController& controller, const ros::NodeHandle& node,
                      const RosContext& context) = 0;

  /// Copies goal frames to mailboxes; the goal thread calls it at 200 Hz. A motion depends on it,
  /// so it must not wait, publish, log or call the ROS master.
  virtual void pollGoal() {}

  /// Publishes queues and mailboxes on topics; the publisher thread calls it at 200 Hz. It must not
  /// call the ROS master, which may not answer: read parameters with getParamCached().
  virtual void spinOnce() = 0;
};

}  // namespace coglab_controllers
