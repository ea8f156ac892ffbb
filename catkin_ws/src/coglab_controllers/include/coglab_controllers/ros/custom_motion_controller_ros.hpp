/// @file
/// Default ROS side of a motion: service start_motion and topic motion_feedback.
#pragma once

#include <ros/ros.h>

#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_controllers/ros/motion_feedback_topic.hpp"
#include "coglab_msgs/StartMotion.h"

namespace coglab_controllers {

/// Service `<id>/start_motion` and topic `<id>/motion_feedback`.
class CustomMotionControllerRos : public MotionControllerRos {
 public:
  ~CustomMotionControllerRos() override { service_.shutdown(); }
  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext& context) override;
  void spinOnce() override { feedback_.spin(*controller_); }

 private:
  bool onStart(coglab_msgs::StartMotion::Request& request,
               coglab_msgs::StartMotion::Response& response);

  CustomMotionController* controller_ = nullptr;
  ros::NodeHandle node_;
  MotionFeedbackTopic feedback_;
  ros::ServiceServer service_;
};

}  // namespace coglab_controllers
