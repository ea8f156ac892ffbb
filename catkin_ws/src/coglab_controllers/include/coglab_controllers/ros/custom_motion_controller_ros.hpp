/// @file
/// Default ROS side of a motion: service start_motion and topic motion_feedback.
#pragma once

#include <ros/ros.h>

#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_msgs/StartMotion.h"

namespace coglab_controllers {

/// Service `<id>/start_motion` and latched topic `<id>/motion_feedback`. The topic has 50 Hz while
/// a motion runs and 5 Hz otherwise. Every change and every end of a motion is published at once.
class CustomMotionControllerRos : public MotionControllerRos {
 public:
  ~CustomMotionControllerRos() override { service_.shutdown(); }
  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext& context) override;
  void spinOnce() override;

 private:
  bool onStart(coglab_msgs::StartMotion::Request& request,
               coglab_msgs::StartMotion::Response& response);
  void publish(const MotionProgress& progress);

  CustomMotionController* controller_ = nullptr;
  ros::NodeHandle node_;
  ros::Publisher feedback_;
  ros::ServiceServer service_;
  MotionProgress progress_;
  std::uint64_t calls_ = 0, told_ = 0;
};

}  // namespace coglab_controllers
