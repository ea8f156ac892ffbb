#include "coglab_controllers/goal/goal_filter.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

void validate(const GoalFilterParameters& p) {
  const auto require = [](bool fine, const std::string& name, const char* expected, double value) {
    if (fine) return;
    throw std::invalid_argument(name + ": expected " + expected + ", got " + std::to_string(value));
  };
  const auto time = [](double t) { return t >= 0.005 && t <= 2.0; };
  const auto from_zero = [](double v) { return v >= 0.0 && std::isfinite(v); };
  const auto positive = [](double v) { return v > 0.0 && std::isfinite(v); };
  require(p.time_constant == 0.0 || time(p.time_constant), "goal time constant",
          "0 (off) or 0.005 to 2 s", p.time_constant);
  require(time(p.noisy_time_constant), "noisy goal time constant", "0.005 to 2 s",
          p.noisy_time_constant);
  require(time(p.noisy_turning_time_constant), "noisy goal turning time constant", "0.005 to 2 s",
          p.noisy_turning_time_constant);
  require(from_zero(p.noisy_speed), "noisy goal speed", "0 m/s or more", p.noisy_speed);
  require(from_zero(p.noisy_turning), "noisy goal turning", "0 rad/s or more", p.noisy_turning);
  require(from_zero(p.predicted_speed), "predicted goal speed", "0 m/s or more", p.predicted_speed);
  require(positive(p.max_speed), "goal max speed", "a positive speed in m/s", p.max_speed);
  require(positive(p.max_innovation), "goal max innovation", "a positive distance in m",
          p.max_innovation);
  require(p.max_angle_innovation > 0.0 && p.max_angle_innovation <= 3.1,
          "goal max angle innovation", "0 to 3.1 rad", p.max_angle_innovation);
}

// s, time for a change of the time constant T, so that g = p + 3 T g' makes no step.
constexpr double kChange = 0.3;

constexpr double kNoiseMemory = 0.35;  // s
// The speed of the noise that counts as full noise.
constexpr double kFullNoise = 0.03;        // m/s
constexpr double kFullTurningNoise = 0.3;  // rad/s
// Noise that passes a primitive with the usual stiffness: mean square speed over squared steps per
// second, 1/s.
constexpr double kPassed = 5.0;

/// The part of an estimated rate that exceeds noise of about `noisy`: zero well below it, the whole
/// rate well above it, and smooth between.
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

void GoalFilter::Track::rest(double constant) noexcept {
  time_constant = constant;
  rate.setZero();
  acceleration.setZero();
  velocity.setZero();
}

/// One step towards a constant input at the distance `error`. Returns the change of the value.
Vector3 GoalFilter::Track::advance(const Vector3& error, double dt) noexcept {
  // The remaining distance is d(t) = (c0 + c1 t + c2 t^2) exp(-t/T), with d, d', d'' given at t =
  // 0.
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

/// One cycle without a new frame.
void GoalFilter::Track::wait(double dt) noexcept {
  if (noise_power > 0.0) noise_power *= std::exp(-dt / kNoiseMemory);
}

/// One cycle with a new frame at the distance `step` from the last one (m, or rotation vector,
/// rad).
void GoalFilter::Track::see(double dt, const Vector3& step, double full) noexcept {
  wait(dt);
  if (++steps >= 3) {
    // Steps of pure noise have second differences of six times their mean square. A jump of the
    // goal is not noise, so one frame counts at most as full noise.
    const double square = (step - 2.0 * last_step + step_before).squaredNorm() / 6.0;
    noise_power += std::min(square / kNoiseMemory, full * full / kPassed);
  }
  step_before = last_step;
  last_step = step;
}

/// Estimated speed (root mean square) that the noise causes in a set-point that follows the goal,
/// as a share of `full`, at most 1.
double GoalFilter::Track::noise(double full) const noexcept {
  return std::min(1.0, std::sqrt(kPassed * noise_power) / full);
}

GoalFilter::GoalFilter(const GoalFilterParameters& parameters) : parameters_(parameters) {
  validate(parameters);
  place_.rest(parameters.time_constant);
  turn_.rest(parameters.time_constant);
}

void GoalFilter::begin(const Pose& goal) noexcept {
  place_ = turn_ = Track();
  restAt(goal.position);
  restAt(goal.orientation);
  seen_ = goal;
}

void GoalFilter::restAt(const Vector3& position) noexcept {
  place_.rest(parameters_.time_constant);
  smooth_ = position_ = position;
}

void GoalFilter::restAt(const Quaternion& orientation) noexcept {
  turn_.rest(parameters_.time_constant);
  smooth_turn_ = orientation_ = orientation.normalized();
}

double GoalFilter::noise() const noexcept { return place_.noise(kFullNoise); }

double GoalFilter::turningNoise() const noexcept { return turn_.noise(kFullTurningNoise); }

void GoalFilter::measureNoise(double dt, const Pose& goal) noexcept {
  if (goal.position == seen_.position && goal.orientation.coeffs() == seen_.orientation.coeffs()) {
    place_.wait(dt);
    turn_.wait(dt);
    return;
  }
  place_.see(dt, goal.position - seen_.position, kFullNoise);
  turn_.see(dt, rotationBetween(seen_.orientation, goal.orientation), kFullTurningNoise);
  seen_ = goal;
}

void GoalFilter::adaptTimeConstant(Track& track, double noisy, double noise,
                                   double dt) const noexcept {
  const double more = std::max(0.0, noisy - parameters_.time_constant);
  const double wanted = parameters_.time_constant + noise * more;
  if (track.time_constant == wanted) return;
  track.time_constant = wanted + (track.time_constant - wanted) * std::exp(-dt / kChange);
}

void GoalFilter::update(double dt, const Pose& goal, bool predicted) noexcept {
  const Quaternion unit = goal.orientation.normalized();
  if (!enabled()) {
    smooth_ = position_ = goal.position;
    smooth_turn_ = orientation_ = unit;
    return;
  }
  if (!(dt > 0.0)) return;
  const Vector3 away = clipped(goal.position - smooth_, parameters_.max_innovation);
  adaptTimeConstant(place_, parameters_.noisy_time_constant, noise(), dt);
  smooth_ += place_.advance(away, dt);
  double noisy = noise() * parameters_.noisy_speed;
  if (predicted) noisy = std::max(noisy, parameters_.predicted_speed);
  place_.velocity = clipped(beyondNoise(place_.rate, noisy), parameters_.max_speed);
  position_ = smooth_ + 3.0 * place_.time_constant * place_.velocity;

  const Vector3 turned =
      clipped(rotationBetween(smooth_turn_, unit), parameters_.max_angle_innovation);
  adaptTimeConstant(turn_, parameters_.noisy_turning_time_constant, turningNoise(), dt);
  smooth_turn_ = (expRotation(turn_.advance(turned, dt)) * smooth_turn_).normalized();
  turn_.velocity = beyondNoise(turn_.rate, turningNoise() * parameters_.noisy_turning);
  orientation_ =
      (expRotation(3.0 * turn_.time_constant * turn_.velocity) * smooth_turn_).normalized();
}

}  // namespace coglab_controllers
