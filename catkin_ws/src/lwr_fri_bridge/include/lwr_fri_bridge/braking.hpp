/// @file
/// Velocity bounds from braking distance: whatever a source asks for, every joint can always be
/// stopped before its position limits, within its acceleration and jerk limits.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/interpolator.hpp"

namespace lwr_fri_bridge {

/// How far an axis moves while it brakes to a stop at full jerk and acceleration, relative to where
/// it is now.
struct BrakingReach {
  double lowest = 0.0;   ///< rad, <= 0
  double highest = 0.0;  ///< rad, >= 0
  double end = 0.0;      ///< rad, where it comes to rest
  double time = 0.0;     ///< s until then
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

/// The cycles without our answer that the bridge reckons with while it brakes: as many as a
/// controller rides through before it ends command mode (coglab_sim's figures; KUKA publishes
/// none). docs/limits_under_loss.md says why the limits hold.
struct LossBudget {
  static constexpr double kInARow = 5.0;
  static constexpr double kPerWindow = 20.0;  ///< of any kWindow cycles: quality UNACCEPTABLE
  static constexpr double kWindow = 100.0;
  /// A connection that has lost nothing for so many cycles is trusted to lose no more than
  /// max(kTrusted cycles, kTrustedTime) during one stop. Matters for periods above 5 ms only, where
  /// the full budget would cost much time near a limit.
  static constexpr std::uint32_t kProvenCycles = 1000;
  static constexpr double kTrusted = 6.0;
  static constexpr double kTrustedTime = 0.1;  ///< s
};

/// Way (rad) that an axis may make in lost cycles of `dt` (s) while it stops within `time` (s),
/// going on with at most `speed` (rad/s, >= 0) in each of them: an upper bound over all losses
/// within the budget. `proven`: the connection is trusted, see LossBudget. Real-time safe.
double lossReserve(double speed, double time, double dt, double max_acceleration, double max_jerk,
                   bool proven);

/// Time (s) of constant speed that the LossBudget costs at most during one stop at FRI period `dt`
/// (s) on a proven connection: what whoever plans a motion keeps before a limit, so that the
/// bridge's own guard finds nothing to cut. Real-time safe.
double lostTime(double dt);

/// What BrakingGuard keeps before a bound besides the margin, rad: a step on the wire is off by up to
/// 0.24e-6 rad (float32 at 3 rad, both ends), and 20 lost cycles repeat it.
constexpr double kWireRounding = 5e-6;

/// Bounds target velocities so that the interpolator's next step leaves every joint able to stop
/// inside its position limits whatever is lost within the LossBudget. A joint that is already
/// outside may only stand or come back.
class BrakingGuard {
 public:
  /// `margin` (rad) is kept from both ends of every range; it must leave room between them.
  /// Besides, kWireRounding is kept.
  BrakingGuard(const JointLimits& limits, double margin);

  /// Cuts `target_velocity` (rad/s) in place and returns the joints that were cut, bit i for joint
  /// i. `proven`: see LossBudget. Real-time safe.
  unsigned bound(const Interpolator& interpolator, double dt, bool proven,
                 Vector7& target_velocity) const;

  const Vector7& lower() const { return lower_; }
  const Vector7& upper() const { return upper_; }

 private:
  struct Range {
    double low, high;  // rad
  };
  Range reach(int joint, const AxisState& state, double target, double dt, bool proven) const;

  Vector7 lower_, upper_, max_velocity_, max_acceleration_, max_jerk_;
};

}  // namespace lwr_fri_bridge
