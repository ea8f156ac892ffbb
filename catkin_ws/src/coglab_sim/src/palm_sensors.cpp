#include "coglab_sim/palm_sensors.hpp"

namespace coglab_sim {
namespace {

constexpr std::uint64_t kNoiseStream = 21, kBiasStream = 22;  // random streams of the seed
const Vector3d kUpward(0.0, 0.0, plant::kGravity);            // m/s^2, what holds against gravity

Quaterniond rotationBy(const Vector3d& vector) {
  const double angle = vector.norm();
  return angle > 0.0 ? Quaterniond(Eigen::AngleAxisd(angle, vector / angle))
                     : Quaterniond::Identity();
}

}  // namespace

PalmSensors::PalmSensors(const PalmNoise& noise, std::uint64_t seed)
    : noise_(noise), random_(seed, kNoiseStream) {
  Random random(seed, kBiasStream);
  const auto within = [&random](double most) {
    Vector3d vector;
    for (double& value : vector) value = most * (2.0 * random.uniform() - 1.0);
    return vector;
  };
  turned_ = within(noise.orientation_bias);
  rate_bias_ = within(noise.rate_bias);
  acceleration_bias_ = within(noise.acceleration_bias);
  force_bias_ = within(noise.force_bias);
  torque_bias_ = within(noise.torque_bias);
}

Vector3d PalmSensors::white(double deviation) {
  Vector3d vector;
  for (double& value : vector) value = deviation * random_.normal();
  return vector;
}

void PalmSensors::observe(const plant::Plant& plant, double dt) {
  if (time_ == 0.0) mean_ = PalmReading();
  time_ += dt;
  const double share = dt / time_;
  const auto average = [share](Vector3d& mean, const Vector3d& now) {
    mean += share * (now - mean);
  };
  mean_.orientation = plant.palm().rotation;
  const Quaterniond to_palm = mean_.orientation.conjugate();
  const Twist twist = plant.palmTwist();
  const Vector3d acceleration =
      moved_ ? Vector3d((twist.linear - velocity_) / dt) : Vector3d(Vector3d::Zero());
  velocity_ = twist.linear;
  moved_ = true;
  average(mean_.angular_velocity, to_palm * twist.angular);
  average(mean_.linear_acceleration, to_palm * (acceleration + kUpward));
  average(mean_.force, to_palm * (plant.touchForce() + plant.push().force));
  average(mean_.torque, to_palm * (plant.touchTorque() + plant.push().torque));
}

void PalmSensors::read() {
  reading_.orientation =
      (mean_.orientation * rotationBy(turned_ + white(noise_.orientation))).normalized();
  reading_.angular_velocity = mean_.angular_velocity + rate_bias_ + white(noise_.rate);
  reading_.linear_acceleration =
      mean_.linear_acceleration + acceleration_bias_ + white(noise_.acceleration);
  reading_.force = mean_.force + force_bias_ + white(noise_.force);
  reading_.torque = mean_.torque + torque_bias_ + white(noise_.torque);
  time_ = 0.0;
}

}  // namespace coglab_sim
