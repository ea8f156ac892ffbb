/// @file
/// Interpolator (D4.10 Figure 1): turns target velocities that arrive at any rate into position
/// commands at the FRI rate, acceleration and jerk limited per joint.
///
/// Closed form per axis: velocity target vf, final acceleration 0, time-optimal for |acceleration|
/// <= A and |jerk| <= J. With d the sign of the change still needed once the acceleration has been
/// brought to zero, v and a counted along d: peak acceleration ap = min(A, sqrt(J (vf - v) + a^2 /
/// 2)), phases t1 = |ap - a| / J, t3 = ap / J, and t2 at ap for the rest. Nothing is stored between
/// ticks besides position, velocity, acceleration.
#pragma once

#include "lwr_fri_bridge/control_port.hpp"
#include "lwr_fri_bridge/joint_limits.hpp"

namespace lwr_fri_bridge {

/// Position (rad), velocity (rad/s), acceleration (rad/s^2) of one axis.
struct AxisState {
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

/// Three phases of constant jerk that lead to a velocity; after them the velocity is kept.
struct AxisProfile {
  double duration[3];      ///< s, >= 0
  double jerk[3];          ///< rad/s^3
  double target_velocity;  ///< rad/s

  /// Time until the target velocity is reached, s.
  double totalTime() const { return duration[0] + duration[1] + duration[2]; }
};

/// Time-optimal profile from (velocity, acceleration) to target_velocity with final acceleration 0.
/// Both limits must be positive. An acceleration beyond its limit is first brought back at full
/// jerk.
AxisProfile planVelocity(double velocity, double acceleration, double target_velocity,
                         double max_acceleration, double max_jerk);

/// State after `dt` (s, >= 0) of following the profile, integrated exactly.
AxisState advance(const AxisState& start, const AxisProfile& profile, double dt);

/// The seven axes. Real-time safe.
class Interpolator {
 public:
  /// Acceleration, jerk and velocity limits are taken from `limits`; position limits are
  /// BrakingGuard's matter.
  explicit Interpolator(const JointLimits& limits);

  /// Stands still at `position`.
  void reset(const Vector7& position);

  /// Goes on from another position, with given velocity and acceleration (after a gap in the
  /// connection).
  void resume(const Vector7& position, const Vector7& velocity, const Vector7& acceleration);

  /// Advances by `dt` towards the target velocities (rad/s), each cut to its velocity limit.
  void step(const Vector7& target_velocity, double dt);

  /// Whether every joint stands: velocity and acceleration exactly zero.
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

}  // namespace lwr_fri_bridge
