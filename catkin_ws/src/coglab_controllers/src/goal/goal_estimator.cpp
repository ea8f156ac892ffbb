#include "coglab_controllers/goal/goal_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

void validate(const GoalEstimatorParameters& parameters) {
  const double t = parameters.time_constant;
  if (!(t == 0.0 || (t >= 0.005 && t <= 2.0))) {
    throw std::invalid_argument("goal time constant: expected 0 (off) or 0.005 to 2 s, got " +
                                std::to_string(t));
  }
  const double noisy = parameters.noisy_time_constant;
  if (!(noisy >= 0.005 && noisy <= 2.0)) {
    throw std::invalid_argument("noisy goal time constant: expected 0.005 to 2 s, got " +
                                std::to_string(noisy));
  }
  const double turning = parameters.noisy_turning_time_constant;
  if (!(turning >= 0.005 && turning <= 2.0)) {
    throw std::invalid_argument("noisy goal turning time constant: expected 0.005 to 2 s, got " +
                                std::to_string(turning));
  }
  if (!(parameters.noisy_speed >= 0.0 && std::isfinite(parameters.noisy_speed))) {
    throw std::invalid_argument("noisy goal speed: expected 0 m/s or more, got " +
                                std::to_string(parameters.noisy_speed));
  }
  if (!(parameters.noisy_turning >= 0.0 && std::isfinite(parameters.noisy_turning))) {
    throw std::invalid_argument("noisy goal turning: expected 0 rad/s or more, got " +
                                std::to_string(parameters.noisy_turning));
  }
  if (!(parameters.predicted_speed >= 0.0 && std::isfinite(parameters.predicted_speed))) {
    throw std::invalid_argument("predicted goal speed: expected 0 m/s or more, got " +
                                std::to_string(parameters.predicted_speed));
  }
  if (!(parameters.max_speed > 0.0 && std::isfinite(parameters.max_speed))) {
    throw std::invalid_argument("goal max speed: expected a positive speed in m/s, got " +
                                std::to_string(parameters.max_speed));
  }
  if (!(parameters.max_innovation > 0.0 && std::isfinite(parameters.max_innovation))) {
    throw std::invalid_argument("goal max innovation: expected a positive distance in m, got " +
                                std::to_string(parameters.max_innovation));
  }
  if (!(parameters.max_angle_innovation > 0.0 && parameters.max_angle_innovation <= 3.1)) {
    throw std::invalid_argument("goal max angle innovation: expected 0 to 3.1 rad, got " +
                                std::to_string(parameters.max_angle_innovation));
  }
}

// The time constant goes from one value to the other within about this time, s: g = p + 3 T g' must
// not step.
constexpr double kChange = 0.3;

double nextTimeConstant(const GoalEstimatorParameters& parameters, double noisy, double present,
                        double noise, double dt) {
  const double more = std::max(0.0, noisy - parameters.time_constant);
  const double wanted = parameters.time_constant + std::clamp(noise, 0.0, 1.0) * more;
  return present == wanted ? present : wanted + (present - wanted) * std::exp(-dt / kChange);
}

/// The part of an estimated rate that is more than noise of about `noisy`: nothing well below it,
/// all of it well above, and smooth between.
Vector3 beyondNoise(const Vector3& rate, double noisy) {
  if (noisy <= 0.0) return rate;
  const double square = rate.squaredNorm() / (noisy * noisy);
  const double power = square * square * square * square;
  return std::isfinite(power) ? Vector3(power / (1.0 + power) * rate) : rate;
}

Vector3 clipped(const Vector3& error, double limit) {
  const double norm = error.norm();
  return norm > limit ? Vector3(error * (limit / norm)) : error;
}

}  // namespace

Vector3 ThirdOrderTracker::advance(const Vector3& error, double dt, double time_constant) noexcept {
  // d(t) = (c0 + c1 t + c2 t^2) exp(-t/T) is the way still to go, with d, d', d'' given at t = 0.
  const double k = 1.0 / time_constant, decay = std::exp(-k * dt);
  const Vector3 c0 = error;
  const Vector3 c1 = k * c0 - rate;
  const Vector3 c2 = 0.5 * (2.0 * k * c1 - k * k * c0 - acceleration);
  const Vector3 polynomial = c0 + dt * (c1 + dt * c2);
  const Vector3 slope = c1 + 2.0 * dt * c2;
  rate = -decay * (slope - k * polynomial);
  acceleration = -decay * (2.0 * c2 - 2.0 * k * slope + k * k * polynomial);
  return error - decay * polynomial;
}

GoalEstimator::GoalEstimator(const GoalEstimatorParameters& parameters)
    : parameters_(parameters), time_constant_(parameters.time_constant) {
  validate(parameters);
}

void GoalEstimator::reset(const Vector3& goal) noexcept {
  tracker_ = {};
  velocity_.setZero();
  time_constant_ = parameters_.time_constant;
  smooth_ = position_ = goal;
}

void GoalEstimator::update(double dt, const Vector3& goal, double noise, bool predicted) noexcept {
  if (!enabled()) {
    smooth_ = position_ = goal;
    return;
  }
  if (!(dt > 0.0)) return;
  const Vector3 error = clipped(goal - smooth_, parameters_.max_innovation);
  time_constant_ =
      nextTimeConstant(parameters_, parameters_.noisy_time_constant, time_constant_, noise, dt);
  smooth_ += tracker_.advance(error, dt, time_constant_);
  double noisy = std::clamp(noise, 0.0, 1.0) * parameters_.noisy_speed;
  if (predicted) noisy = std::max(noisy, parameters_.predicted_speed);
  velocity_ = clipped(beyondNoise(tracker_.rate, noisy), parameters_.max_speed);
  position_ = smooth_ + 3.0 * time_constant_ * velocity_;
}

OrientationEstimator::OrientationEstimator(const GoalEstimatorParameters& parameters)
    : parameters_(parameters), time_constant_(parameters.time_constant) {
  validate(parameters);
}

void OrientationEstimator::reset(const Quaternion& target) noexcept {
  tracker_ = {};
  velocity_.setZero();
  time_constant_ = parameters_.time_constant;
  smooth_ = orientation_ = target.normalized();
}

void OrientationEstimator::update(double dt, const Quaternion& target, double noise) noexcept {
  const Quaternion unit = target.normalized();
  if (parameters_.time_constant <= 0.0) {
    smooth_ = orientation_ = unit;
    return;
  }
  if (!(dt > 0.0)) return;
  const Vector3 error = clipped(rotationBetween(smooth_, unit), parameters_.max_angle_innovation);
  time_constant_ = nextTimeConstant(parameters_, parameters_.noisy_turning_time_constant,
                                    time_constant_, noise, dt);
  smooth_ = (expRotation(tracker_.advance(error, dt, time_constant_)) * smooth_).normalized();
  velocity_ = beyondNoise(tracker_.rate, std::clamp(noise, 0.0, 1.0) * parameters_.noisy_turning);
  orientation_ = (expRotation(3.0 * time_constant_ * velocity_) * smooth_).normalized();
}

}  // namespace coglab_controllers
