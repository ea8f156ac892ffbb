#include "lwr_fri_bridge/interpolator.hpp"

#include <algorithm>
#include <cmath>

namespace lwr_fri_bridge {

AxisProfile planVelocity(double velocity, double acceleration, double target_velocity,
                         double max_acceleration, double max_jerk) {
  const double per_jerk = 1.0 / max_jerk;
  // Velocity that is reached by doing nothing but bringing the acceleration to zero.
  const double coasting = velocity + 0.5 * acceleration * std::abs(acceleration) * per_jerk;
  const double d = target_velocity >= coasting ? 1.0 : -1.0;
  const double a = d * acceleration;
  const double dv = d * (target_velocity - velocity);

  const double peak = std::sqrt(std::max(0.0, max_jerk * dv + 0.5 * a * a));
  AxisProfile profile;
  profile.target_velocity = target_velocity;
  profile.jerk[0] = d * max_jerk;
  profile.jerk[1] = 0.0;
  profile.jerk[2] = -d * max_jerk;
  if (peak <= max_acceleration) {
    profile.duration[0] = std::max(0.0, (peak - a) * per_jerk);
    profile.duration[1] = 0.0;
    profile.duration[2] = peak * per_jerk;
  } else {
    const double sign =
        a > max_acceleration ? -1.0 : 1.0;  // an acceleration beyond the limit comes down first
    profile.duration[0] = sign * (max_acceleration - a) * per_jerk;
    profile.jerk[0] *= sign;
    const double dv1 = 0.5 * sign * (max_acceleration * max_acceleration - a * a) * per_jerk;
    const double dv3 = 0.5 * max_acceleration * max_acceleration * per_jerk;
    profile.duration[1] = std::max(0.0, (dv - dv1 - dv3) / max_acceleration);
    profile.duration[2] = max_acceleration * per_jerk;
  }
  return profile;
}

AxisState advance(const AxisState& start, const AxisProfile& profile, double dt) {
  AxisState s = start;
  for (int phase = 0; phase < 3; ++phase) {
    const bool within = dt < profile.duration[phase];
    const double t = within ? dt : profile.duration[phase];
    const double j = profile.jerk[phase];
    s.position += t * (s.velocity + t * (0.5 * s.acceleration + t * j * (1.0 / 6.0)));
    s.velocity += t * (s.acceleration + 0.5 * t * j);
    s.acceleration += t * j;
    if (within) return s;
    dt -= t;
  }
  // Arrived: rounding must not leave a creeping rest of acceleration or velocity.
  s.velocity = profile.target_velocity;
  s.acceleration = 0.0;
  s.position += dt * s.velocity;
  return s;
}

Interpolator::Interpolator(const JointLimits& limits)
    : max_velocity_(limits.velocity),
      max_acceleration_(limits.acceleration),
      max_jerk_(limits.jerk) {}

void Interpolator::reset(const Vector7& position) {
  position_ = position;
  velocity_.setZero();
  acceleration_.setZero();
}

void Interpolator::resume(const Vector7& position, const Vector7& velocity,
                          const Vector7& acceleration) {
  position_ = position;
  velocity_ = velocity;
  acceleration_ = acceleration;
}

void Interpolator::step(const Vector7& target_velocity, double dt) {
  for (int i = 0; i < 7; ++i) {
    const double target = std::clamp(target_velocity[i], -max_velocity_[i], max_velocity_[i]);
    const AxisProfile profile =
        planVelocity(velocity_[i], acceleration_[i], target, max_acceleration_[i], max_jerk_[i]);
    const AxisState next = advance(axis(i), profile, dt);
    position_[i] = next.position;
    velocity_[i] = next.velocity;
    acceleration_[i] = next.acceleration;
  }
}

bool Interpolator::standsStill() const {
  return (velocity_.array() == 0.0).all() && (acceleration_.array() == 0.0).all();
}

}  // namespace lwr_fri_bridge
