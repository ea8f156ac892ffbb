#include "coglab_controllers/ros/custom_motion_controller_ros.hpp"

#include "coglab_msgs/MotionFeedback.h"

namespace coglab_controllers {

void CustomMotionControllerRos::attach(MotionController& controller, const ros::NodeHandle& node,
                                       const RosContext&) {
  controller_ = &dynamic_cast<CustomMotionController&>(controller);
  node_ = node;
  feedback_ = node_.advertise<coglab_msgs::MotionFeedback>("motion_feedback", 100, true);
  service_ = node_.advertiseService("start_motion", &CustomMotionControllerRos::onStart, this);
}

bool CustomMotionControllerRos::onStart(coglab_msgs::StartMotion::Request& request,
                                        coglab_msgs::StartMotion::Response& response) {
  const MotionAnswer answer =
      controller_->startMotion({request.names, request.values, request.queue != 0});
  response.status = answer.status;
  response.motion_id = answer.id;
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  if (!answer.success) ROS_WARN("start_motion rejected: %s", answer.message.c_str());
  return true;
}

void CustomMotionControllerRos::spinOnce() {
  ++calls_;
  const MotionProgress before = progress_;
  const bool fresh = controller_->readProgress(progress_);
  // The end of each motion, also of those that ended between two looks.
  for (EndedMotion end; controller_->readEnd(end);) {
    MotionProgress last = progress_;
    last.id = end.id;
    last.state = end.executed ? MotionState::Reached : MotionState::Aborted;
    last.reason = end.reason;
    publish(last);
    if (!end.executed)
      ROS_LOG(endLevel(end.reason), ROSCONSOLE_DEFAULT_NAME, "motion_id %d was not executed: %s",
              end.id, end.reason.c_str());
  }
  if (!fresh) return;
  const bool changed = progress_.state != before.state || progress_.id != before.id ||
                       progress_.reason.code() != before.reason.code();
  const bool moving =
      progress_.state == MotionState::Running || progress_.state == MotionState::Holding;
  if (changed || calls_ - told_ >= (moving ? 4u : 40u)) publish(progress_);
}

void CustomMotionControllerRos::publish(const MotionProgress& progress) {
  told_ = calls_;
  coglab_msgs::MotionFeedback message;
  message.header.stamp = toRos(progress.stamp_ns);
  message.motion_id = progress.id;
  message.state = nameOf(progress.state);
  message.reason_code = progress.reason.number();
  message.reason = progress.reason.str();
  message.time = progress.time;
  message.queued = progress.queued;
  feedback_.publish(message);
}

}  // namespace coglab_controllers
