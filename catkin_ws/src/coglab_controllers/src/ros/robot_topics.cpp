#include "coglab_controllers/ros/robot_topics.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "coglab_rt/braking.hpp"
#include "coglab_rt/reason.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

using coglab_rt::Vector7;

bool RobotTopics::inOrder(const std::vector<std::string>& names, const std::vector<double>& values,
                          Vector7& out) const {
  for (std::size_t joint = 0; joint < names_.size(); ++joint) {
    const auto found = std::find(names.begin(), names.end(), names_[joint]);
    const std::size_t at = static_cast<std::size_t>(found - names.begin());
    if (found == names.end() || at >= values.size() || !std::isfinite(values[at])) return false;
    out[static_cast<int>(joint)] = values[at];
  }
  return true;
}

RobotTopics::RobotTopics(const ros::NodeHandle& node, const coglab_rt::JointLimits& limits,
                         std::function<void()> sample_written)
    : node_(node),
      sample_written_(std::move(sample_written)),
      names_(limits.names),
      set_point_(limits) {
  sample_.stop_rounding = 2.0 * coglab_rt::kWireRounding;
  target_ = node_.advertise<sensor_msgs::JointState>("target_joint_states", 5);
  target_message_.name.assign(names_.begin(), names_.end());
  target_message_.velocity.resize(names_.size());
  const auto hints = ros::TransportHints().tcpNoDelay();
  state_ = node_.subscribe("state", 10, &RobotTopics::onState, this, hints);
  torques_ = node_.subscribe("external_torques", 1, &RobotTopics::onTorques, this, hints);
  wrench_ = node_.subscribe("tool_wrench", 1, &RobotTopics::onWrench, this, hints);
  joints_ = node_.subscribe("joint_states", 1, &RobotTopics::onJoints, this, hints);
}

void RobotTopics::onJoints(const sensor_msgs::JointState& joints) {
  const std::int64_t stamp = coglab_rt::toSteady(joints.header.stamp);
  const std::int64_t ahead = -coglab_rt::ageOf(joints.header.stamp);
  // After a stamp from the future all later ones would seem old.
  if (stamp <= last_stamp_ns_ || ahead > coglab_rt::kFutureAllowance_ns ||
      !inOrder(joints.name, joints.position, sample_.position)) {
    ROS_WARN_THROTTLE(
        1.0,
        "joint_states refused: expected a stamp newer than the last one and not ahead of the "
        "clock, and finite positions of %zu arm joints",
        names_.size());
    return;
  }
  if (!inOrder(joints.name, joints.velocity, sample_.velocity)) sample_.velocity.setZero();
  if (!inOrder(joints.name, joints.effort, sample_.torque)) sample_.torque.setZero();
  // True spacing of the measurements, smoothed: topics jitter.
  const double passed = 1e-9 * static_cast<double>(stamp - last_stamp_ns_);
  if (last_stamp_ns_ != 0 && passed < 0.5) {
    sample_.cycle_time =
        sample_.cycle_time > 0.0 ? 0.98 * sample_.cycle_time + 0.02 * passed : passed;
  }
  // The interface in the other process may lose packets.
  sample_.stop_delay = coglab_rt::lostTime(sample_.cycle_time);
  last_stamp_ns_ = stamp;
  ++sample_.sequence;
  sample_.stamp_ns = stamp;
  sample_.controller_ns = stamp;  // the topic carries no counter
  VelocityCommand sent;
  sent_.read(sent);
  const bool follows = sample_.block == MotionBlock::None;
  set_point_.step(follows ? sent.velocity : Vector7(Vector7::Zero()), std::min(passed, 0.1));
  sample_.commanded_velocity = set_point_.velocity();
  sample_.commanded_acceleration = set_point_.acceleration();
  sample_.commanded_position = sample_.position;
  mailboxes_.publishSample(sample_);
  sample_written_();
}

void RobotTopics::onState(const coglab_msgs::LwrState& state) {
  sample_.block =
      state.motion_allowed ? MotionBlock::None : coglab_rt::motionBlockOf(state.reason_code);
  sample_.motion_epoch = state.motion_epoch;
}

void RobotTopics::onTorques(const sensor_msgs::JointState& torques) {
  inOrder(torques.name, torques.effort, sample_.external_torque);
}

void RobotTopics::onWrench(const geometry_msgs::WrenchStamped& wrench) {
  const auto& f = wrench.wrench.force;
  const auto& t = wrench.wrench.torque;
  coglab_rt::Vector6 values;
  values << f.x, f.y, f.z, t.x, t.y, t.z;
  if (values.allFinite()) sample_.tool_wrench = values;
}

void RobotTopics::send(const VelocityCommand& command) {
  sent_.write(command);
  // Stamp and epoch of the joint state behind the velocity. They identify a message that is late or
  // from before a hold.
  target_message_.header.stamp = coglab_rt::toRos(command.stamp_ns);
  target_message_.header.frame_id = std::to_string(command.motion_epoch);
  for (int joint = 0; joint < 7; ++joint) {
    target_message_.velocity[static_cast<std::size_t>(joint)] = command.velocity[joint];
  }
  target_.publish(target_message_);
}

}  // namespace coglab_controllers
