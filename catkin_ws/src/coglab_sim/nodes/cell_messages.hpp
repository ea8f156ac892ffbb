/// @file
/// Between the cell's types and ROS messages.
#pragma once

#include <coglab_msgs/CellTruth.h>
#include <coglab_msgs/FingerContact.h>

#include "coglab_sim/cell.hpp"

namespace coglab_sim {

template <typename Message>
Vector3d vectorOf(const Message& m) {
  return {m.x, m.y, m.z};
}

/// Whether a vector is finite and not longer than `most`: what is beyond it would end the physics.
inline bool isWithin(const Vector3d& vector, double most) {
  return vector.allFinite() && vector.cwiseAbs().maxCoeff() <= most;
}

constexpr double kFarthest = 100.0;  // m, of anything in the cell

/// False if a number is not finite or farther than kFarthest, or the quaternion is not of length 1
/// within 1 %.
inline bool poseOf(const geometry_msgs::Pose& message, Pose& pose) {
  const auto& q = message.orientation;
  pose.position = vectorOf(message.position);
  pose.rotation = Quaterniond(q.w, q.x, q.y, q.z);
  if (!isWithin(pose.position, kFarthest) || !(std::abs(pose.rotation.norm() - 1.0) < 0.01)) {
    return false;
  }
  pose.rotation.normalize();
  return true;
}

inline geometry_msgs::Vector3 vectorMessage(const Vector3d& v) {
  geometry_msgs::Vector3 message;
  message.x = v.x();
  message.y = v.y();
  message.z = v.z();
  return message;
}

inline geometry_msgs::Pose poseMessage(const Pose& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.position.x();
  message.position.y = pose.position.y();
  message.position.z = pose.position.z();
  message.orientation.x = pose.rotation.x();
  message.orientation.y = pose.rotation.y();
  message.orientation.z = pose.rotation.z();
  message.orientation.w = pose.rotation.w();
  return message;
}

inline coglab_msgs::CellTruth truthMessage(const CellTruth& truth, const std::string& object_id,
                                           const ros::Time& stamp) {
  coglab_msgs::CellTruth message;
  message.header.stamp = stamp;
  message.header.frame_id = "world";
  message.object_id = object_id;
  message.object = poseMessage(truth.object);
  message.object_velocity.linear = vectorMessage(truth.object_twist.linear);
  message.object_velocity.angular = vectorMessage(truth.object_twist.angular);
  message.human_hand = poseMessage(truth.human_hand);
  message.robot_hand = poseMessage(truth.robot_hand);
  message.palm_force = vectorMessage(truth.palm_force);
  message.robot_load_share = truth.robot_load_share;
  message.human_load_share = truth.human_load_share;
  message.held_by = truth.held_by;
  message.dropped = truth.dropped;
  return message;
}

inline coglab_msgs::FingerContact contactMessage(const FingerContactState& state,
                                                 const ros::Time& stamp) {
  coglab_msgs::FingerContact message;
  message.header.stamp = stamp;
  message.contact_position.assign(state.position.begin(), state.position.end());
  message.stiffness.assign(state.stiffness.begin(), state.stiffness.end());
  return message;
}

}  // namespace coglab_sim
