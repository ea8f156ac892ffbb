#include "coglab_controllers/ros/signal_messages.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {
namespace {

constexpr int kFingers = 5;

template <typename Vector>
void append(std::vector<double>& numbers, const Vector& v) {
  numbers.insert(numbers.end(), {v.x, v.y, v.z});
}

template <typename Quaternion>
void appendQuaternion(std::vector<double>& numbers, const Quaternion& q) {
  numbers.insert(numbers.end(), {q.x, q.y, q.z, q.w});
}

template <typename Vector>
std::vector<double> two(const Vector& first, const Vector& second) {
  std::vector<double> numbers;
  append(numbers, first);
  append(numbers, second);
  return numbers;
}

template <typename Covariance>
bool isThere(const Covariance& covariance) {
  return covariance[0] != -1.0;
}

std::vector<double> numbersOf(const sensor_msgs::Imu& message) {
  std::vector<double> numbers;
  appendQuaternion(numbers, message.orientation);
  append(numbers, message.angular_velocity);
  append(numbers, message.linear_acceleration);
  return numbers;
}

std::vector<double> numbersOf(const geometry_msgs::PoseStamped& message) {
  std::vector<double> numbers;
  append(numbers, message.pose.position);
  appendQuaternion(numbers, message.pose.orientation);
  return numbers;
}

std::vector<double> numbersOf(const coglab_msgs::FingertipForces& message) {
  if (message.fingers.size() != message.forces.size()) {
    throw std::invalid_argument("expected a finger for each of " +
                                std::to_string(message.forces.size()) + " forces, got " +
                                std::to_string(message.fingers.size()));
  }
  std::vector<double> numbers(3 * (kFingers + 1), 0.0);
  const auto add = [&numbers](int place, const geometry_msgs::Vector3& force) {
    const auto first = static_cast<std::size_t>(3 * place);
    numbers[first] += force.x;
    numbers[first + 1] += force.y;
    numbers[first + 2] += force.z;
  };
  for (std::size_t i = 0; i < message.forces.size(); ++i) {
    const int finger = message.fingers[i];
    if (finger < 0 || finger >= kFingers) {
      throw std::invalid_argument("expected fingers 0 .. 4, got " + std::to_string(finger));
    }
    add(finger, message.forces[i]);
  }
  add(kFingers, message.palm);
  return numbers;
}

}  // namespace

template <typename Message>
SignalReading::SignalReading(const Message& message, std::vector<double> numbers)
    : numbers_(std::move(numbers)) {
  message_.stamp_ns = coglab_rt::toSteady(message.header.stamp);
  message_.frame = message.header.frame_id;
}

void SignalReading::field(std::size_t first, std::size_t size, bool there) {
  message_.fields.push_back({numbers_.data() + first, there ? size : 0});
}

SignalReading::SignalReading(const sensor_msgs::Imu& message)
    : SignalReading(message, numbersOf(message)) {
  field(0, 4, isThere(message.orientation_covariance));
  field(4, 3, isThere(message.angular_velocity_covariance));
  field(7, 3, isThere(message.linear_acceleration_covariance));
}

SignalReading::SignalReading(const geometry_msgs::WrenchStamped& message)
    : SignalReading(message, two(message.wrench.force, message.wrench.torque)) {
  field(0, 3);
  field(3, 3);
  field(0, 6);
}

SignalReading::SignalReading(const geometry_msgs::PoseStamped& message)
    : SignalReading(message, numbersOf(message)) {
  field(0, 3);
  field(3, 4);
  field(0, 7);
}

SignalReading::SignalReading(const geometry_msgs::TwistStamped& message)
    : SignalReading(message, two(message.twist.linear, message.twist.angular)) {
  field(0, 3);
  field(3, 3);
  field(0, 6);
}

SignalReading::SignalReading(const sensor_msgs::JointState& message)
    : SignalReading(message, message.position) {
  const std::size_t velocity = numbers_.size();
  numbers_.insert(numbers_.end(), message.velocity.begin(), message.velocity.end());
  const std::size_t effort = numbers_.size();
  numbers_.insert(numbers_.end(), message.effort.begin(), message.effort.end());
  field(0, message.position.size());
  field(velocity, message.velocity.size());
  field(effort, message.effort.size());
  message_.joint_names = message.name;
}

SignalReading::SignalReading(const std_msgs::Float64MultiArray& message) : numbers_(message.data) {
  field(0, numbers_.size());
}

SignalReading::SignalReading(const coglab_msgs::FingertipForces& message)
    : SignalReading(message, numbersOf(message)) {
  field(0, numbers_.size());
}

}  // namespace coglab_controllers
