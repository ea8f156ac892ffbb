// The tf2 helper of D4.10: any frame, with an offset, to dmp_goal in dmp_frame_name.
#include <chrono>
#include <cmath>
#include <exception>
#include <string>

#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/ros/ros_parameters.hpp"
#include "coglab_controllers/ros/tf_goal_source.hpp"
#include "coglab_msgs/DmpGoal.h"

namespace coglab_controllers {

/// Publishes the position of a frame whenever a new transform has come, stamped with its time of
/// capture; what is old or not finite is not published.
class GoalHelper {
 public:
  /// @param node of the topic's name, which is relative to it  @param own the node's parameters
  GoalHelper(const ros::NodeHandle& node, const ros::NodeHandle& own)
      : node_(node), listener_(buffer_) {
    const Parameters parameters(readParameters(own), "goal_helper");
    frame_ = parameters.text("frame", "human_hand");
    dmp_frame_ = parameters.text("dmp_frame_name", "lwr_base_link");
    offset_ = parameters.numbers("offset", Eigen::VectorXd::Zero(3));
    rate_ = parameters.number("rate", 100.0, 0.1, 1000.0);
    goal_ = node_.advertise<coglab_msgs::DmpGoal>(
        parameters.text("topic", "controller_manager/dmp/dmp_goal"), 1);
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
    geometry_msgs::TransformStamped transform;
    try {
      transform = buffer_.lookupTransform(dmp_frame_, frame_, ros::Time(0));
    } catch (const tf2::TransformException& error) {
      ROS_WARN_THROTTLE(5.0, "no goal: frame '%s' is not known in '%s': %s", frame_.c_str(),
                        dmp_frame_.c_str(), error.what());
      return;
    }
    const ros::Time stamp = transform.header.stamp;
    // A static frame has no stamp; it is published once, and then counts as captured on arrival.
    if (published_ && stamp == last_) return;
    const auto& t = transform.transform.translation;
    const auto& q = transform.transform.rotation;
    const Quaternion turn(q.w, q.x, q.y, q.z);
    const Vector3 goal = Vector3(t.x, t.y, t.z) + turn * offset_;
    if (!goal.allFinite() || !isUnit(turn)) {
      ROS_WARN_THROTTLE(5.0, "no goal: the transform of '%s' is not finite", frame_.c_str());
      return;
    }
    last_ = stamp;
    published_ = true;
    coglab_msgs::DmpGoal message;
    message.header.stamp = stamp;
    message.header.frame_id = dmp_frame_;
    message.goal.x = goal.x();
    message.goal.y = goal.y();
    message.goal.z = goal.z();
    goal_.publish(message);
  }

  ros::NodeHandle node_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
  ros::Publisher goal_;
  std::string frame_, dmp_frame_;
  Vector3 offset_ = Vector3::Zero();
  double rate_ = 100.0;
  ros::Time last_;
  bool published_ = false;
};

}  // namespace coglab_controllers

int main(int argc, char** argv) {
  ros::init(argc, argv, "goal_helper");
  try {
    coglab_controllers::GoalHelper(ros::NodeHandle(), ros::NodeHandle("~")).run();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
