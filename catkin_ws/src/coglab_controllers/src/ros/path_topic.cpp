#include "coglab_controllers/ros/path_topic.hpp"

#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

namespace {

constexpr std::uint64_t kEvery = 40;  // calls, 0.2 s

}  // namespace

void write(const Pose& pose, geometry_msgs::Pose& message) {
  message.position.x = pose.position.x();
  message.position.y = pose.position.y();
  message.position.z = pose.position.z();
  message.orientation.x = pose.orientation.x();
  message.orientation.y = pose.orientation.y();
  message.orientation.z = pose.orientation.z();
  message.orientation.w = pose.orientation.w();
}

coglab_msgs::PredictedPath toMessage(const PredictedPath& path, const std::string& frame) {
  coglab_msgs::PredictedPath message;
  message.header.stamp = coglab_rt::toRos(path.stamp_ns);
  message.header.frame_id = frame;
  message.motion = path.motion;
  message.times = path.path.times;
  message.poses.resize(path.path.poses.size());
  for (std::size_t i = 0; i < message.poses.size(); ++i) {
    write(path.path.poses[i], message.poses[i]);
  }
  return message;
}

void PathTopic::attach(ros::NodeHandle& node, const std::string& frame) {
  frame_ = frame;
  publisher_ = node.advertise<coglab_msgs::PredictedPath>("predicted_path", 5);
}

bool PathTopic::due(bool moving) {
  if (!moving) {
    calls_ = 0;
    if (shown_) {
      PredictedPath none;
      none.stamp_ns = steadyNow();
      publish(none);
    }
    shown_ = false;
    return false;
  }
  return calls_++ % kEvery == 0 && publisher_.getNumSubscribers() > 0;
}

void PathTopic::publish(const PredictedPath& path) {
  publisher_.publish(toMessage(path, frame_));
  shown_ = true;
}

}  // namespace coglab_controllers
