/// @file
/// Velocity bounds from braking distance: whatever a source asks for, every joint can always be
/// stopped before its position limits, within its acceleration and jerk limits.
#pragma once

#include "lwr_fri_bridge/interpolator.hpp"

namespace lwr_fri_bridge {

/// How far an axis moves while it brakes to a stop at full jerk and acceleration, relative to where
/// it is now.
struct BrakingReach {
  double lowest = 0.0;   ///< rad, <= 0
  double highest = 0.0;  ///< rad, >= 0
  double end = 0.0;      ///< rad, where it comes to rest
};

/// Reach of the time-optimal stop from (velocity, acceleration). Real-time safe.
BrakingReach brakingReach(double velocity, double acceleration, double max_acceleration,
                          double max_jerk);

/// Distance of the stop from constant speed (rad/s, >= 0), acceleration 0: v/2 (v/A + A/J), or v
/// sqrt(v/J) where the acceleration limit is not reached.
double brakingDistance(double speed, double max_acceleration, double max_jerk);

/// Highest constant speed (rad/s) from which an axis stops within `distance` (rad) after going on
/// at that speed for `delay` (s): inverse of delay*v + brakingDistance(v). 0 for distance <= 0. For
/// guards that plan with margins, such as the controller manager's; the bridge itself looks one
/// tick ahead with the exact state (BrakingGuard).
double brakingSpeed(double distance, double max_acceleration, double max_jerk, double delay);

/// Bounds target velocities so that the interpolator's next step leaves every joint able to stop
/// inside its position limits even if one more cycle passes at constant speed. A joint that is
/// already outside may only stand or come back.
class BrakingGuard {
 public:
  /// `margin` (rad) is kept from both ends of every range; it must leave room between them.
  BrakingGuard(const JointLimits& limits, double margin);

  /// Cuts `target_velocity` (rad/s) in place and returns the joints that were cut, bit i for joint
  /// i. Real-time safe.
  unsigned bound(const Interpolator& interpolator, double dt, Vector7& target_velocity) const;

  const Vector7& lower() const { return lower_; }
  const Vector7& upper() const { return upper_; }

 private:
  bool admissible(int joint, const AxisState& state, double target, double dt, double low,
                  double high) const;

  Vector7 lower_, upper_, max_velocity_, max_acceleration_, max_jerk_;
};

}  // namespace lwr_fri_bridge
