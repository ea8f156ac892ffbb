/// @file
/// The robot behind topics (split:=true): joint_states in, target_joint_states out (D4.10, Tables 1
/// and 6).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <coglab_msgs/LwrState.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include "coglab_controllers/names.hpp"
#include "coglab_rt/interpolator.hpp"

namespace coglab_controllers {

/// Fills mailboxes from the topics of a robot interface in another process.
///
/// Measured values come from `joint_states`, `external_torques` and `tool_wrench`, the permission
/// to move from `state`. The commanded state is not on a topic. So the measured position counts as
/// commanded; velocity and acceleration are computed from the sent velocities with the interface's
/// interpolator. Callbacks run in one thread; that thread writes the samples.
class RobotTopics {
 public:
  /// @param node namespace of the robot interface (…/lwr)
  /// @param limits names of the joints, and how the robot interface brakes and accelerates
  /// @param sample_written called after each joint state: wakes the control thread
  RobotTopics(const ros::NodeHandle& node, const coglab_rt::JointLimits& limits,
              std::function<void()> sample_written);

  coglab_rt::ArmMailboxes& mailboxes() { return mailboxes_; }

  /// Publishes a velocity and remembers it as commanded. Control thread.
  void send(const VelocityCommand& command);

 private:
  /// Sorts values into the order of the arm. False if a joint is missing or a value is not finite.
  bool inOrder(const std::vector<std::string>& names, const std::vector<double>& values,
               coglab_rt::Vector7& out) const;
  void onJoints(const sensor_msgs::JointState& joints);
  void onState(const coglab_msgs::LwrState& state);
  void onTorques(const sensor_msgs::JointState& torques);
  void onWrench(const geometry_msgs::WrenchStamped& wrench);

  ros::NodeHandle node_;
  std::function<void()> sample_written_;
  const std::array<std::string, 7> names_;
  coglab_rt::ArmMailboxes mailboxes_;
  RobotSample sample_;
  coglab_rt::Interpolator set_point_;
  TripleBuffer<VelocityCommand> sent_;  // control thread to callbacks
  ros::Subscriber joints_, state_, torques_, wrench_;
  ros::Publisher target_;
  sensor_msgs::JointState target_message_;  // control thread
  std::int64_t last_stamp_ns_ = 0;
};

}  // namespace coglab_controllers
