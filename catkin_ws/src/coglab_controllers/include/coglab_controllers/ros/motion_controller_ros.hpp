/// @file
/// The ROS side of a motion controller plug-in: its services and topics, below its id.
#pragma once

#include <chrono>
#include <cstdint>

#include <ros/node_handle.h>
#include <ros/time.h>
#include <tf2_ros/buffer.h>

#include "coglab_controllers/manager/motion_controller.hpp"

namespace coglab_controllers {

/// What every ROS side shares.
struct RosContext {
  tf2_ros::Buffer* tf = nullptr;  ///< filled by a listener; outlives the ROS sides
};

/// Steady clock, ns: the clock of samples, plans and goals.
inline std::int64_t steadyNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// A time of the steady clock as ROS time, through both clocks' present readings.
inline ros::Time toRos(std::int64_t steady_ns) {
  return ros::Time::now() - ros::Duration().fromNSec(steadyNow() - steady_ns);
}

/// A ROS time on the steady clock; zero stays zero.
inline std::int64_t toSteady(const ros::Time& time) {
  if (time.isZero()) return 0;
  return steadyNow() - (ros::Time::now() - time).toNSec();
}

/// Made by the plug-in's library beside the controller
/// (COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS).
class MotionControllerRos {
 public:
  virtual ~MotionControllerRos() = default;

  /// Advertises and subscribes below `node` (…/controller_manager/<id>). The controller outlives
  /// this object.
  virtual void attach(MotionController& controller, const ros::NodeHandle& node,
                      const RosContext& context) = 0;

  /// Called by the publisher thread, 200 times a second: queues and mailboxes to topics, frames to
  /// mailboxes.
  virtual void spinOnce() = 0;
};

}  // namespace coglab_controllers
