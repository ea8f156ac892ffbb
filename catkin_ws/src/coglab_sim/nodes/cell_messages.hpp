/// @file
/// Conversions between the cell's types and ROS messages.
#pragma once

#include <coglab_msgs/CellTruth.h>
#include <coglab_msgs/FingertipForces.h>
#include <coglab_msgs/MotorCommands.h>
#include <coglab_msgs/MotorStates.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/Imu.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "coglab_rt/ros/ros_time.hpp"
#include "coglab_sim/real_time_cell.hpp"

namespace coglab_sim {

/// Stamp of the messages of a snapshot, however late they are published: the time of its physics
/// step as ROS time, or the simulated time if that is ROS time.
inline ros::Time stampOf(const CellSnapshot& snapshot, bool simulated) {
  ros::Time stamp;
  return simulated ? stamp.fromSec(snapshot.truth.time) : coglab_rt::toRos(snapshot.stepped_ns);
}

template <typename Message>
Vector3d vectorOf(const Message& m) {
  return {m.x, m.y, m.z};
}

/// True if a vector is finite and not longer than `most`; others would make the physics fail.
inline bool isWithin(const Vector3d& vector, double most) {
  return vector.allFinite() && vector.cwiseAbs().maxCoeff() <= most;
}

constexpr double kFarthest = 100.0;  // m, largest distance in the cell

/// False if a number is not finite, a position is beyond kFarthest, or the quaternion's length
/// differs from 1 by more than 1 %.
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
  message.hand_closure = truth.hand_closure;
  message.palm_force = vectorMessage(truth.palm_force);
  message.touch_force = vectorMessage(truth.touch_force);
  message.human_force = vectorMessage(truth.human_force);
  message.robot_load_share = truth.robot_load_share;
  message.human_load_share = truth.human_load_share;
  message.held_by = truth.held_by;
  message.dropped = truth.dropped;
  return message;
}

inline coglab_msgs::MotorStates motorsMessage(const MotorStates& motors, const ros::Time& stamp) {
  coglab_msgs::MotorStates message;
  message.header.stamp = stamp;
  for (const plant::MotorState& motor : motors) {
    message.position.push_back(motor.position);
    message.current.push_back(motor.current);
    message.effort.push_back(motor.effort);
    message.moving.push_back(motor.moving);
    message.locked.push_back(motor.locked);
  }
  return message;
}

/// Measurement of the IMU in the palm.
inline sensor_msgs::Imu imuMessage(const PalmReading& palm, const PalmNoise& noise,
                                   const ros::Time& stamp) {
  sensor_msgs::Imu message;
  message.header.stamp = stamp;
  message.header.frame_id = plant::kPalmFrame;
  message.orientation = poseMessage({Vector3d::Zero(), palm.orientation}).orientation;
  message.angular_velocity = vectorMessage(palm.angular_velocity);
  message.linear_acceleration = vectorMessage(palm.linear_acceleration);
  for (const std::size_t diagonal : {0, 4, 8}) {
    message.orientation_covariance[diagonal] = noise.orientation * noise.orientation;
    message.angular_velocity_covariance[diagonal] = noise.rate * noise.rate;
    message.linear_acceleration_covariance[diagonal] = noise.acceleration * noise.acceleration;
  }
  return message;
}

/// Measurement of the wrench sensor in the palm: load of object, person and push on the hand.
inline geometry_msgs::WrenchStamped wrenchMessage(const PalmReading& palm, const ros::Time& stamp) {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = plant::kPalmFrame;
  message.wrench.force = vectorMessage(palm.force);
  message.wrench.torque = vectorMessage(palm.torque);
  return message;
}

/// Contact forces of the physics, without noise.
inline coglab_msgs::FingertipForces touchMessage(const plant::Touch& touch,
                                                 const plant::HandTable& hand,
                                                 const ros::Time& stamp) {
  coglab_msgs::FingertipForces message;
  message.header.stamp = stamp;
  message.header.frame_id = plant::kPalmFrame;
  for (std::size_t i = 0; i < touch.phalanges.size(); ++i) {
    message.phalanges.push_back(hand.phalanges[i].name);
    message.fingers.push_back(static_cast<int>(hand.phalanges[i].finger));
    message.forces.push_back(vectorMessage(touch.phalanges[i]));
  }
  message.palm = vectorMessage(touch.palm);
  return message;
}

/// @throws std::invalid_argument with expected and received value.
inline MotorCommands motorsOf(const coglab_msgs::MotorCommands& message) {
  MotorCommands commands;
  const auto check = [&](const std::vector<double>& list, const char* name, double most) {
    if (list.size() != commands.size())
      throw std::invalid_argument(std::string("expected ") + name + " of 5 motors, got " +
                                  std::to_string(list.size()));
    for (const double value : list) {
      if (!(value >= 0.0 && value <= most))
        throw std::invalid_argument(std::string("expected ") + name + " in 0.." +
                                    std::to_string(most) + ", got " + std::to_string(value));
    }
  };
  check(message.speed, "speed", 1.0);
  check(message.target, "target", 1.0);
  check(message.current, "current", 1e4);
  for (std::size_t i = 0; i < commands.size(); ++i)
    commands[i] = {message.speed[i], message.target[i], message.current[i]};
  return commands;
}

}  // namespace coglab_sim
