/// @file
/// Interpolator (D4.10 Figure 1): converts target velocities that arrive at any rate into position
/// commands at the rate of the arm's interface, with acceleration and jerk limits per joint.
///
/// Closed form per axis: velocity target vf, final acceleration 0, time-optimal for |acceleration|
/// <= A and |jerk| <= J. Let d be the sign of the change that remains after the acceleration has
/// been brought to zero; v and a are counted along d. Peak acceleration ap = min(A, sqrt(J (vf - v)
/// + a^2 / 2)); phases t1 = |ap - a| / J, t3 = ap / J, and t2 at ap for the rest. Between ticks
/// only position, velocity and acceleration are stored.
#pragma once

#include <algorithm>
#include <cmath>

#include "coglab_rt/joint_limits.hpp"

namespace coglab_rt {

/// Position (rad), velocity (rad/s), acceleration (rad/s^2) of one axis.
struct AxisState {
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

/// Three phases of constant jerk that lead to a velocity, which is then kept.
struct AxisProfile {
  double duration[3];      ///< s, >= 0
  double jerk[3];          ///< rad/s^3
  double target_velocity;  ///< rad/s

  /// Time until the target velocity is reached, s.
  double totalTime() const { return duration[0] + duration[1] + duration[2]; }
};

/// Time-optimal profile from (velocity, acceleration) to target_velocity with final acceleration 0.
/// Both limits must be positive. An acceleration above its limit is first reduced at full jerk.
AxisProfile planVelocity(double velocity, double acceleration, double target_velocity,
                         double max_acceleration, double max_jerk);

/// State after following the profile for `dt` (s, >= 0), integrated exactly.
AxisState advance(const AxisState& start, const AxisProfile& profile, double dt);

/// The seven axes. Real-time safe.
class Interpolator {
 public:
  /// Uses the acceleration, jerk and velocity limits of `limits`. BrakingGuard observes the
  /// position limits.
  explicit Interpolator(const JointLimits& limits);

  /// Sets the state to rest at `position`.
  void reset(const Vector7& position);

  /// Continues from another position with given velocity and acceleration (after an interruption of
  /// the connection).
  void resume(const Vector7& position, const Vector7& velocity, const Vector7& acceleration);

  /// Advances by `dt` (s) towards the target velocities (rad/s), each reduced to its velocity
  /// limit.
  void step(const Vector7& target_velocity, double dt);

  /// True if every joint is at rest: velocity and acceleration are exactly zero.
  bool standsStill() const;

  AxisState axis(int joint) const {
    return {position_[joint], velocity_[joint], acceleration_[joint]};
  }
  const Vector7& position() const { return position_; }
  const Vector7& velocity() const { return velocity_; }
  const Vector7& acceleration() const { return acceleration_; }

 private:
  Vector7 max_velocity_, max_acceleration_, max_jerk_;
  Vector7 position_ = Vector7::Zero(), velocity_ = Vector7::Zero(), acceleration_ = Vector7::Zero();
};

// Implementation

inline AxisProfile planVelocity(double velocity, double acceleration, double target_velocity,
                                double max_acceleration, double max_jerk) {
  const double per_jerk = 1.0 / max_jerk;
  // Velocity that results if only the acceleration is brought to zero.
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
        a > max_acceleration ? -1.0 : 1.0;  // an acceleration above the limit is reduced first
    profile.duration[0] = sign * (max_acceleration - a) * per_jerk;
    profile.jerk[0] *= sign;
    const double dv1 = 0.5 * sign * (max_acceleration * max_acceleration - a * a) * per_jerk;
    const double dv3 = 0.5 * max_acceleration * max_acceleration * per_jerk;
    profile.duration[1] = std::max(0.0, (dv - dv1 - dv3) / max_acceleration);
    profile.duration[2] = max_acceleration * per_jerk;
  }
  return profile;
}

inline AxisState advance(const AxisState& start, const AxisProfile& profile, double dt) {
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
  // The target is reached: rounding must not leave a small acceleration or velocity.
  s.velocity = profile.target_velocity;
  s.acceleration = 0.0;
  s.position += dt * s.velocity;
  return s;
}

inline Interpolator::Interpolator(const JointLimits& limits)
    : max_velocity_(limits.velocity),
      max_acceleration_(limits.acceleration),
      max_jerk_(limits.jerk) {}

inline void Interpolator::reset(const Vector7& position) {
  position_ = position;
  velocity_.setZero();
  acceleration_.setZero();
}

inline void Interpolator::resume(const Vector7& position, const Vector7& velocity,
                                 const Vector7& acceleration) {
  position_ = position;
  velocity_ = velocity;
  acceleration_ = acceleration;
}

inline void Interpolator::step(const Vector7& target_velocity, double dt) {
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

inline bool Interpolator::standsStill() const {
  return (velocity_.array() == 0.0).all() && (acceleration_.array() == 0.0).all();
}

}  // namespace coglab_rt
