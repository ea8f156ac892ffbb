/// @file
/// Touch sensors of the hand on their way into the control cycle.
#pragma once

#include <string>

#include <coglab_msgs/FingertipForces.h>
#include <ros/ros.h>

#include "coglab_controllers/manager/controller_manager.hpp"

namespace coglab_controllers {

/// Sums the forces of a message finger by finger. @throws std::invalid_argument with what was
/// expected and what came. @param tool frame that the forces have to be in
TouchForces touchForcesOf(const coglab_msgs::FingertipForces& message, const std::string& tool);

/// Subscribes the topic that the parameter `tactile_topic` names, by default
/// `ih2_hand/fingertip_forces`, counted from the namespace above the manager's, and hands its
/// forces to the manager as the signal `touch`.
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
