#include "coglab_controllers/ros/motion_feedback_topic.hpp"

#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_msgs/MotionFeedback.h"

namespace coglab_controllers {

void MotionFeedbackTopic::attach(ros::NodeHandle& node) {
  topic_ = node.advertise<coglab_msgs::MotionFeedback>("motion_feedback", 100, true);
}

void MotionFeedbackTopic::publishEnd(const EndedMotion& end) {
  MotionProgress last = progress_;
  last.id = end.id;
  last.state = end.executed ? MotionState::Reached : MotionState::Aborted;
  last.reason = end.reason;
  publish(last);
  if (!end.executed)
    ROS_LOG(endLevel(end.reason), ROSCONSOLE_DEFAULT_NAME, "motion_id %d was not executed: %s",
            end.id, end.reason.c_str());
}

void MotionFeedbackTopic::publishProgress(const MotionProgress& before, bool fresh) {
  ++calls_;
  if (!fresh) return;
  const bool changed = progress_.state != before.state || progress_.id != before.id ||
                       progress_.reason.code() != before.reason.code();
  const bool moving =
      progress_.state == MotionState::Running || progress_.state == MotionState::Holding;
  if (changed || calls_ - published_ >= (moving ? 4u : 40u)) publish(progress_);
}

void MotionFeedbackTopic::publish(const MotionProgress& progress) {
  published_ = calls_;
  coglab_msgs::MotionFeedback message;
  message.header.stamp = toRos(progress.stamp_ns);
  message.motion_id = progress.id;
  message.state = nameOf(progress.state);
  message.reason_code = progress.reason.number();
  message.reason = progress.reason.str();
  message.time = progress.time;
  message.queued = progress.queued;
  topic_.publish(message);
}

}  // namespace coglab_controllers
