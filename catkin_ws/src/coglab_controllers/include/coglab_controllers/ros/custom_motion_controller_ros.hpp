/// @file
/// The ROS side that every motion gets whose author wrote none: start_motion and motion_feedback.
#pragma once

#include <ros/ros.h>

#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_msgs/StartMotion.h"

namespace coglab_controllers {

/// `<id>/start_motion` (service) and `<id>/motion_feedback` (latched topic): 50 Hz while a motion
/// is under way, 5 Hz otherwise, every change and the end of each motion at once.
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
