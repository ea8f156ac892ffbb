// The tf2 helper of D4.10: publishes any frame, with an offset, on dmp_goal in dmp_frame_name.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>

#include <ros/ros.h>
#include <tf2/buffer_core.h>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/manager/parameters.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_msgs/DmpGoal.h"
#include "coglab_rt/ros/logger_service.hpp"
#include "coglab_rt/ros/node_start.hpp"
#include "coglab_rt/ros/parameter_tree.hpp"

namespace coglab_controllers {

constexpr std::int64_t kStaticPeriod_ns = 1'000'000'000;

/// Publishes the position of a frame for each new transform, stamped with its time of capture. The
/// DMP plug-in does not check goals from dmp_goal, so this node publishes only goals that pass
/// GoalLimits: not from the future, not old, not far from the frames before, and none until the
/// first frames agree. A static frame is published once a second.
class GoalHelper {
 public:
  /// @param node of the topic's name, which is relative to it  @param own the node's parameters
  GoalHelper(const ros::NodeHandle& node, const ros::NodeHandle& own)
      : node_(node), listener_(buffer_) {
    const Parameters parameters(coglab_rt::readParameterTree(own), "goal_helper");
    frame_ = parameters.text("frame", "human_hand");
    dmp_frame_ = parameters.text("dmp_frame_name", "lwr_base_link");
    offset_ = parameters.numbers("offset", Eigen::VectorXd::Zero(3));
    rate_ = parameters.number("rate", 100.0, 0.1, 1000.0);
    goal_ = node_.advertise<coglab_msgs::DmpGoal>(
        parameters.text("topic", "controller_manager/dmp/dmp_goal"), 1);
    listener_.start();
  }

  void run() {
    ros::WallRate rate(rate_);
    while (ros::ok()) {
      ros::spinOnce();
      publish();
      rate.sleep();
    }
  }

 private:
  void publish() {
    GoalObservation seen;
    std::string why;
    if (!source_.lookup(dmp_frame_, frame_, seen, why)) {
      ROS_WARN_THROTTLE(5.0, "no goal: frame '%s' is not known in '%s': %s", frame_.c_str(),
                        dmp_frame_.c_str(), why.c_str());
      return;
    }
    if (!seen.position.allFinite() || !isUnit(seen.orientation)) {
      ROS_WARN_THROTTLE(5.0, "no goal: the transform of '%s' is not finite", frame_.c_str());
      return;
    }
    const std::int64_t now = steadyNow();
    if (limits_.update(now, seen, now) != GoalLimits::State::Fresh) {
      warn();
      return;
    }
    const GoalObservation& goal = limits_.goal();
    if (isPublished(goal, now)) return;
    published_goal_ = goal;
    published_ns_ = now;
    const Vector3 position = goal.position + goal.orientation * offset_;
    coglab_msgs::DmpGoal message;
    message.header.stamp.fromNSec(static_cast<std::uint64_t>(goal.frame_ns));
    message.header.frame_id = dmp_frame_;
    message.goal.x = position.x();
    message.goal.y = position.y();
    message.goal.z = position.z();
    goal_.publish(message);
  }

  bool isPublished(const GoalObservation& goal, std::int64_t now) const {
    if (published_ns_ == 0 || goal.frame_ns != published_goal_.frame_ns ||
        goal.clock_steps != published_goal_.clock_steps) {
      return false;
    }
    // A static frame has no stamp: it is published repeatedly, as captured now.
    return goal.frame_ns != 0 || now - published_ns_ < kStaticPeriod_ns;
  }

  void warn() const {
    if (limits_.state() == GoalLimits::State::Unsettled) {
      ROS_WARN_THROTTLE(5.0, "no goal yet: too few transforms of '%s' agree", frame_.c_str());
      return;
    }
    ROS_WARN_THROTTLE(5.0,
                      "no goal: the newest transform of '%s' is %.3f s old and %.3f m away from "
                      "the last goal",
                      frame_.c_str(), limits_.age(), limits_.jump());
  }

  ros::NodeHandle node_;
  tf2::BufferCore buffer_;
  TfListener listener_;
  TfGoalSource source_{buffer_, listener_};
  GoalLimits limits_;
  GoalObservation published_goal_;
  std::int64_t published_ns_ = 0;  // time of the last publication; 0: none
  ros::Publisher goal_;
  std::string frame_, dmp_frame_;
  Vector3 offset_ = Vector3::Zero();
  double rate_ = 100.0;
};

}  // namespace coglab_controllers

int main(int argc, char** argv) {
  ros::init(argc, argv, "goal_helper");
  if (!coglab_rt::nameIsFree()) return 1;
  try {
    coglab_rt::LoggerServices logger_services;
    coglab_controllers::GoalHelper(ros::NodeHandle(), ros::NodeHandle("~")).run();
  } catch (const std::exception& error) {
    // ROS ended with the node's last handle, so its log no longer prints.
    std::fprintf(stderr, "goal_helper_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
