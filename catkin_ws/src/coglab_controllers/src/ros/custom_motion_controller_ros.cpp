#include "coglab_controllers/ros/custom_motion_controller_ros.hpp"

namespace coglab_controllers {

void CustomMotionControllerRos::attach(MotionController& controller, const ros::NodeHandle& node,
                                       const RosContext&) {
  controller_ = &dynamic_cast<CustomMotionController&>(controller);
  node_ = node;
  feedback_.attach(node_);
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

}  // namespace coglab_controllers
