#include "target_topic.hpp"

#include "coglab_rt/ros/ros_time.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"

namespace lwr_fri_bridge {

void TargetTopic::start(ros::NodeHandle& nh) {
  subscriber_ = nh.subscribe("target_joint_states", 1, &TargetTopic::onMessage, this,
                             ros::TransportHints().tcpNoDelay());
}

TargetTopic::Refused TargetTopic::refused() const {
  return {invalid_, stamp_, old_permission_, active_, second_, not_allowed_};
}

bool TargetTopic::mayMove(const std::string& publisher) {
  if (one_process_ && controller_active_) {
    ++active_;
    ROS_WARN_THROTTLE(5.0,
                      "lwr: target_joint_states of %s refused: a controller of this process moves "
                      "the arm; end that first: rosservice call %s \"''\"",
                      publisher.c_str(),
                      ros::names::resolve("controller_manager/switch_controller").c_str());
    return false;
  }
  // Two publishers would move the arm to and fro. The current publisher keeps the arm until it
  // pauses.
  const double pause = 1e-9 * static_cast<double>(steadyNow() - followed_ns_);
  if (publisher == publisher_ || followed_ns_ == 0 || pause >= bridge_.config().topic_timeout)
    return true;
  ++second_;
  ROS_WARN_THROTTLE(5.0,
                    "lwr: target_joint_states of %s refused: %s moves the arm; end that one's "
                    "motion first (it has to pause for %g s, topic_timeout)",
                    publisher.c_str(), publisher_.c_str(), bridge_.config().topic_timeout);
  return false;
}

void TargetTopic::countAndSay(const TargetVerdict& verdict, const std::string& publisher) {
  switch (verdict.fault) {
    case TargetFault::None:
      return;
    case TargetFault::Invalid:
      ++invalid_;
      break;
    case TargetFault::Stamp:
      ++stamp_;
      break;
    case TargetFault::Epoch:
      ++old_permission_;
      break;
  }
  ROS_WARN_THROTTLE(5.0, "lwr: target_joint_states of %s refused: %s", publisher.c_str(),
                    verdict.sentence.c_str());
}

void TargetTopic::onMessage(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  if (closing_) return;
  const std::string& publisher = event.getPublisherName();
  // In one process the controller manager also publishes here the velocities that it already sent.
  if (one_process_ && publisher == ros::this_node::getName()) return;
  if (!mayMove(publisher)) return;

  const sensor_msgs::JointState& message = *event.getMessage();
  const Snapshot now = bridge_.snapshot();
  TargetPermission permission;
  permission.epoch = now.sample.motion_epoch;
  permission.since_ns = now.permission_since_ns;
  permission.now_ns = steadyNow();
  permission.longest_ns = static_cast<std::int64_t>(1e9 * bridge_.config().topic_timeout);
  const TargetVerdict verdict =
      judgeTarget({message.name, message.velocity, !message.header.stamp.isZero(),
                   coglab_rt::ageOf(message.header.stamp), message.header.frame_id},
                  permission);
  if (verdict.fault != TargetFault::None) return countAndSay(verdict, publisher);
  if (now.sample.block != MotionBlock::None) {
    ++not_allowed_;
    ROS_WARN_THROTTLE(5.0, "lwr: target_joint_states of %s refused: %s%s", publisher.c_str(),
                      reasonOf(now.sample.block, now.sample.blocking_joint, now.loss).c_str(),
                      advice(now.sample.block).c_str());
    // The leash needs the requested velocity: it is released when no outward motion is requested.
    if (now.sample.block != MotionBlock::Leashed) return;
  }
  bridge_.sendTopicVelocity(verdict.command);
  publisher_ = publisher;
  followed_ns_ = permission.now_ns;
}

}  // namespace lwr_fri_bridge
