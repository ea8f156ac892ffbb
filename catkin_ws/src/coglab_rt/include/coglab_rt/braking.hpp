/// @file
/// Velocity bounds from braking distance: whatever a source asks for, every joint can always be
/// stopped before its position limits, within its acceleration and jerk limits.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "coglab_rt/interpolator.hpp"

namespace coglab_rt {

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

/// What BrakingGuard keeps before a bound besides the margin, rad: a step on the wire is off by up
/// to 0.24e-6 rad (float32 at 3 rad, both ends), and 20 lost cycles repeat it.
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

// Implementation

inline BrakingReach brakingReach(double velocity, double acceleration, double max_acceleration,
                                 double max_jerk) {
  const AxisProfile stop = planVelocity(velocity, acceleration, 0.0, max_acceleration, max_jerk);
  BrakingReach reach;
  reach.end = advance({0.0, velocity, acceleration}, stop, stop.totalTime()).position;
  reach.time = stop.totalTime();
  reach.lowest = std::min(0.0, reach.end);
  reach.highest = std::max(0.0, reach.end);
  // The velocity changes its sign at most once, in the first phase, where the acceleration still
  // has the old direction.
  const double j = stop.jerk[0];
  const double root = acceleration * acceleration - 2.0 * j * velocity;
  if (velocity * acceleration < 0.0 && root >= 0.0 && j != 0.0) {
    const double t = (-acceleration + std::copysign(std::sqrt(root), acceleration)) / j;
    if (t > 0.0 && t < stop.duration[0]) {
      const double turn = t * (velocity + t * (0.5 * acceleration + t * j / 6.0));
      reach.lowest = std::min(reach.lowest, turn);
      reach.highest = std::max(reach.highest, turn);
    }
  }
  return reach;
}

inline double brakingDistance(double speed, double max_acceleration, double max_jerk) {
  if (speed * max_jerk < max_acceleration * max_acceleration)
    return speed * std::sqrt(speed / max_jerk);
  return 0.5 * speed * (speed / max_acceleration + max_acceleration / max_jerk);
}

inline double brakingSpeed(double distance, double max_acceleration, double max_jerk,
                           double delay) {
  if (!(distance > 0.0)) return 0.0;
  // With the acceleration limit reached the equation is quadratic; below that it is cubic in
  // sqrt(v), solved by Newton from above, where it is convex and cannot undershoot.
  const double corner = max_acceleration * max_acceleration / max_jerk;
  const double linear = delay + 0.5 * max_acceleration / max_jerk;
  if (delay * corner + brakingDistance(corner, max_acceleration, max_jerk) <= distance) {
    return max_acceleration *
           (std::sqrt(linear * linear + 2.0 * distance / max_acceleration) - linear);
  }
  double root = std::sqrt(corner);
  const double inv = 1.0 / std::sqrt(max_jerk);
  for (int i = 0; i < 20; ++i) {
    const double f = root * root * (delay + root * inv) - distance;
    const double slope = root * (2.0 * delay + 3.0 * root * inv);
    const double next = root - f / slope;
    if (!(next < root)) break;
    root = next;
  }
  return root * root;
}

inline double lossReserve(double speed, double time, double dt, double max_acceleration,
                          double max_jerk, bool proven) {
  using B = LossBudget;
  if (!(speed > 0.0)) return 0.0;
  // Up to kInARow cycles before each answer that brakes, and after the last one, whose step still
  // has a length.
  const double cycles = std::min(B::kPerWindow, B::kInARow * (time / dt + 2.0));
  double way = cycles * dt * speed;
  // Losses of later windows come at the speed that is left then. While the acceleration turns round
  // (2 A/J) nothing is gained, at the end the speed lies above the straight line (A/J / 2).
  const double late = 2.5 * max_acceleration / max_jerk;
  const double spacing = (B::kWindow - B::kPerWindow) * dt;
  for (double begin = spacing; begin < time; begin += spacing) {
    const double left = std::min(speed, speed - max_acceleration * (begin - late));
    if (left <= 0.0) break;
    way += B::kPerWindow * dt * left;
  }
  if (!proven) return way;
  return std::min(way, std::max(B::kTrusted * dt, B::kTrustedTime) * speed);
}

inline double lostTime(double dt) {
  using B = LossBudget;
  return std::min(B::kPerWindow * dt, std::max(B::kTrusted * dt, B::kTrustedTime));
}

inline BrakingGuard::BrakingGuard(const JointLimits& limits, double margin)
    : lower_(limits.lower_position.array() + (margin + kWireRounding)),
      upper_(limits.upper_position.array() - (margin + kWireRounding)),
      max_velocity_(limits.velocity),
      max_acceleration_(limits.acceleration),
      max_jerk_(limits.jerk) {}

/// What one step towards `target` and a stop after it may reach, losses included.
inline BrakingGuard::Range BrakingGuard::reach(int joint, const AxisState& state, double target,
                                               double dt, bool proven) const {
  const double a = max_acceleration_[joint], j = max_jerk_[joint];
  const AxisState next =
      advance(state, planVelocity(state.velocity, state.acceleration, target, a, j), dt);
  const BrakingReach stop = brakingReach(next.velocity, next.acceleration, a, j);
  // A lost cycle repeats the last step, so its speed counts as well as those to come; the latter
  // peak where the present acceleration has been brought to zero.
  const double step = (next.position - state.position) / dt;
  const double coasting = next.velocity + 0.5 * next.acceleration * std::abs(next.acceleration) / j;
  const double up = std::max({0.0, step, next.velocity, coasting});
  const double down = std::max({0.0, -step, -next.velocity, -coasting});
  return {next.position + stop.lowest - lossReserve(down, stop.time, dt, a, j, proven),
          next.position + stop.highest + lossReserve(up, stop.time, dt, a, j, proven)};
}

inline unsigned BrakingGuard::bound(const Interpolator& interpolator, double dt, bool proven,
                                    Vector7& target_velocity) const {
  constexpr double tiny = 1e-12;
  unsigned cut = 0;
  for (int i = 0; i < 7; ++i) {
    const AxisState state = interpolator.axis(i);
    const double target = std::clamp(target_velocity[i], -max_velocity_[i], max_velocity_[i]);
    target_velocity[i] = target;
    const auto within = [&](double part, double low, double high) {
      const Range range = reach(i, state, part * target, dt, proven);
      return range.low >= low && range.high <= high;
    };
    if (within(1.0, lower_[i], upper_[i])) continue;

    // What braking at once would reach is unavoidable; a joint outside its range must still be
    // allowed to come back.
    const Range braked = reach(i, state, 0.0, dt, proven);
    const double high = std::max(upper_[i], braked.high + tiny);
    const double low = std::min(lower_[i], braked.low - tiny);
    if (within(1.0, low, high) && (low < lower_[i] ? target >= 0.0 : true) &&
        (high > upper_[i] ? target <= 0.0 : true)) {
      continue;
    }
    // Largest admissible part of the target; 0 is admissible by construction. 30 halvings: 1e-9 of
    // the target.
    double good = 0.0, bad = 1.0;
    for (int step = 0; step < 30; ++step) {
      const double middle = 0.5 * (good + bad);
      (within(middle, low, high) ? good : bad) = middle;
    }
    target_velocity[i] = good * target;
    cut |= 1U << i;
  }
  return cut;
}

}  // namespace coglab_rt
