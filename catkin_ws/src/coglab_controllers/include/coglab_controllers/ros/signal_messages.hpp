/// @file
/// The numbers of ROS messages, in the order of signalTypes().
#pragma once

#include <vector>

#include <coglab_msgs/FingertipForces.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>

#include "coglab_controllers/manager/signal_inputs.hpp"

namespace coglab_controllers {

/// A message for SignalInputs::post(), with the numbers that it refers to.
class SignalReading {
 public:
  /// Omits the orientation if `orientation_covariance[0]` is -1 (the message's definition), and
  /// likewise the other two fields.
  explicit SignalReading(const sensor_msgs::Imu& message);
  explicit SignalReading(const geometry_msgs::WrenchStamped& message);
  explicit SignalReading(const geometry_msgs::PoseStamped& message);
  explicit SignalReading(const geometry_msgs::TwistStamped& message);
  explicit SignalReading(const sensor_msgs::JointState& message);
  explicit SignalReading(const std_msgs::Float64MultiArray& message);
  /// Takes the sum over the phalanges of each finger.
  /// @throws std::invalid_argument with the expected and the received value
  explicit SignalReading(const coglab_msgs::FingertipForces& message);
  SignalReading(const SignalReading&) = delete;
  SignalReading& operator=(const SignalReading&) = delete;

  const SignalMessage& message() const { return message_; }

 private:
  template <typename Message>
  SignalReading(const Message& message, std::vector<double> numbers);
  void field(std::size_t first, std::size_t size, bool there = true);

  std::vector<double> numbers_;
  SignalMessage message_;
};

}  // namespace coglab_controllers
