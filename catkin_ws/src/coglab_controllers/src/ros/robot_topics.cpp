#include "coglab_controllers/ros/robot_topics.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "coglab_controllers/ros/motion_controller_ros.hpp"

namespace coglab_controllers {

namespace {

using lwr_fri_bridge::MotionBlock;
using lwr_fri_bridge::Vector7;

const std::vector<std::string> kJoints = {"lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3",
                                          "lwr_a4", "lwr_a5", "lwr_a6"};

/// Sorts values into wire order. False if a joint is missing or a value is not finite.
bool inWireOrder(const std::vector<std::string>& names, const std::vector<double>& values,
                 Vector7& out) {
  for (std::size_t joint = 0; joint < kJoints.size(); ++joint) {
    const auto found = std::find(names.begin(), names.end(), kJoints[joint]);
    const std::size_t at = static_cast<std::size_t>(found - names.begin());
    if (found == names.end() || at >= values.size() || !std::isfinite(values[at])) return false;
    out[static_cast<int>(joint)] = values[at];
  }
  return true;
}

MotionBlock blockOf(const coglab_msgs::LwrState& state) {
  if (state.motion_allowed) return MotionBlock::None;
  if (state.hold_latched) return MotionBlock::Held;
  if (state.supervisor == "disconnected") return MotionBlock::Disconnected;
  if (state.supervisor == "monitor") return MotionBlock::Monitor;
  if (state.supervisor == "stopping") return MotionBlock::Stopping;
  return MotionBlock::NotStarted;
}

}  // namespace

RobotTopics::RobotTopics(const ros::NodeHandle& node, std::function<void()> sample_written)
    : node_(node), sample_written_(std::move(sample_written)) {
  target_ = node_.advertise<sensor_msgs::JointState>("target_joint_states", 5);
  target_message_.name = kJoints;
  target_message_.velocity.resize(kJoints.size());
  const auto hints = ros::TransportHints().tcpNoDelay();
  state_ = node_.subscribe("state", 10, &RobotTopics::onState, this, hints);
  torques_ = node_.subscribe("external_torques", 1, &RobotTopics::onTorques, this, hints);
  wrench_ = node_.subscribe("tool_wrench", 1, &RobotTopics::onWrench, this, hints);
  joints_ = node_.subscribe("joint_states", 1, &RobotTopics::onJoints, this, hints);
}

void RobotTopics::onJoints(const sensor_msgs::JointState& joints) {
  const std::int64_t stamp = toSteady(joints.header.stamp);
  if (stamp <= last_stamp_ns_ || !inWireOrder(joints.name, joints.position, sample_.position)) {
    ROS_WARN_THROTTLE(
        1.0, "joint_states refused: expected a new stamp, and finite positions of %zu arm joints",
        kJoints.size());
    return;
  }
  if (!inWireOrder(joints.name, joints.velocity, sample_.velocity)) sample_.velocity.setZero();
  if (!inWireOrder(joints.name, joints.effort, sample_.torque)) sample_.torque.setZero();
  // True spacing of the measurements, smoothed: topics jitter.
  const double passed = 1e-9 * static_cast<double>(stamp - last_stamp_ns_);
  if (last_stamp_ns_ != 0 && passed < 0.5) {
    sample_.cycle_time =
        sample_.cycle_time > 0.0 ? 0.98 * sample_.cycle_time + 0.02 * passed : passed;
  }
  last_stamp_ns_ = stamp;
  ++sample_.sequence;
  sample_.stamp_ns = stamp;
  sample_.controller_ns = stamp;  // the topic carries no counter
  lwr_fri_bridge::VelocityCommand sent;
  sent_.read(sent);
  sample_.commanded_velocity = sent.velocity;
  sample_.commanded_position = sample_.position;
  port_.publishSample(sample_);
  sample_written_();
}

void RobotTopics::onState(const coglab_msgs::LwrState& state) {
  const MotionBlock block = blockOf(state);
  if (sample_.block == MotionBlock::None && block != MotionBlock::None) ++sample_.motion_epoch;
  sample_.block = block;
}

void RobotTopics::onTorques(const sensor_msgs::JointState& torques) {
  inWireOrder(torques.name, torques.effort, sample_.external_torque);
}

void RobotTopics::onWrench(const geometry_msgs::WrenchStamped& wrench) {
  const auto& f = wrench.wrench.force;
  const auto& t = wrench.wrench.torque;
  lwr_fri_bridge::Vector6 values;
  values << f.x, f.y, f.z, t.x, t.y, t.z;
  if (values.allFinite()) sample_.tool_wrench = values;
}

void RobotTopics::send(const lwr_fri_bridge::VelocityCommand& command) {
  sent_.write(command);
  target_message_.header.stamp = ros::Time::now();
  for (int joint = 0; joint < 7; ++joint) {
    target_message_.velocity[static_cast<std::size_t>(joint)] = command.velocity[joint];
  }
  target_.publish(target_message_);
}

}  // namespace coglab_controllers
