/// @file
/// Passes the hand's touch forces from a topic to the control cycle.
#pragma once

#include <string>

#include <coglab_msgs/FingertipForces.h>
#include <ros/ros.h>

#include "coglab_controllers/manager/controller_manager.hpp"

namespace coglab_controllers {

/// Sums the forces of a message for each finger. @param tool required frame of the forces
/// @throws std::invalid_argument with the expected and the received value
TouchForces touchForcesOf(const coglab_msgs::FingertipForces& message, const std::string& tool);

/// Subscribes to the topic in the parameter `tactile_topic` (default `ih2_hand/fingertip_forces`,
/// relative to the namespace above the manager's). It passes the forces to the manager as the
/// signal `touch`.
class TouchTopic {
 public:
  /// @param node namespace of the manager; its callback queue is used
  TouchTopic(const ros::NodeHandle& node, ControllerManager& manager);

 private:
  void onForces(const coglab_msgs::FingertipForces& message);

  ControllerManager& manager_;
  ros::NodeHandle node_;
  std::string tool_;
  ros::Subscriber forces_;
};

}  // namespace coglab_controllers
