/// @file
/// Velocity bounds from braking distances. Whatever velocity is requested, every joint can always
/// be stopped before its position limits, within its acceleration and jerk limits.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "coglab_rt/interpolator.hpp"

namespace coglab_rt {

/// Displacement of an axis while it brakes to a stop at full jerk and acceleration, relative to its
/// current position.
struct BrakingReach {
  double lowest = 0.0;   ///< rad, <= 0
  double highest = 0.0;  ///< rad, >= 0
  double end = 0.0;      ///< rad, where it comes to rest
};

/// Reach of the time-optimal stop from (velocity, acceleration). Real-time safe.
BrakingReach brakingReach(double velocity, double acceleration, double max_acceleration,
                          double max_jerk);

/// The same along the profile of the stop.
BrakingReach brakingReach(double velocity, double acceleration, const AxisProfile& stop);

/// Distance (rad) of a stop from constant speed (rad/s, >= 0) with acceleration 0: v/2 (v/A + A/J),
/// or v sqrt(v/J) if the acceleration limit is not reached.
double brakingDistance(double speed, double max_acceleration, double max_jerk);

/// Highest constant speed (rad/s) from which an axis stops within `distance` (rad) if braking
/// begins after `delay` (s): inverse of delay*v + brakingDistance(v). 0 for distance <= 0. For
/// guards that plan with margins, such as that of the controller manager. The bridge itself checks
/// the next tick with the exact state (BrakingGuard).
double brakingSpeed(double distance, double max_acceleration, double max_jerk, double delay);

/// Cycles without an answer that a back end must tolerate, at every period: the number that a robot
/// controller tolerates before it ends command mode. The values are those of coglab_sim; makers
/// publish none. docs/limits_under_loss.md explains why the limits hold.
struct LossBudget {
  static constexpr int kInARow = 5;
  static constexpr int kPerWindow = 20;  ///< of any kWindow cycles (limit of quality UNACCEPTABLE)
  static constexpr int kWindow = 100;
};

/// Largest additional displacement of a stop because of lost cycles, rad, both >= 0.
struct LossReserve {
  double down, up;
};

/// Upper bound of the displacement of an axis in lost cycles of `dt` (s), over all losses within
/// the LossBudget. The last answer that the controller received moved the axis from `before` to
/// `after`. Each later answer brakes at once along `stop`. Each lost cycle repeats the step of the
/// answer before it. The displacement of the answers themselves is that of brakingReach. Real-time
/// safe.
LossReserve lossReserve(const AxisState& before, const AxisState& after, const AxisProfile& stop,
                        double dt, double max_jerk);

/// Time (s) at constant speed whose displacement is at least the lossReserve of one window of the
/// LossBudget at period `dt` (s) of the arm's interface. A planner of motions keeps this distance
/// from a limit, so that the bridge's guard does not cut the motion while no cycles or single
/// cycles are lost. Bursts of losses at full speed and long periods use more before the planner is
/// informed. Then the guard does cut, see docs/limits_under_loss.md. Real-time safe.
double lostTime(double dt);

/// Rounding (rad) that one lost cycle can add on the connection to the arm (float32 at 3 rad):
/// 0.24e-6 for both ends of the repeated step, and 0.24e-6 for the set-point that is reported after
/// it.
constexpr double kLossRounding = 0.5e-6;

/// Distance (rad) that BrakingGuard keeps from a bound in addition to the margin: the rounding of
/// one window of lost cycles.
constexpr double kWireRounding = LossBudget::kPerWindow * kLossRounding;

/// Bounds target velocities so that, after the interpolator's next step, every joint can stop
/// inside its position limits after any losses within the LossBudget. If even braking at once
/// cannot ensure this, for example for a joint that is outside already, the joint brakes at once or
/// turns away from the limit.
class BrakingGuard {
 public:
  /// `margin` (rad) is kept from both ends of every range and must leave room between them.
  /// kWireRounding is kept in addition.
  BrakingGuard(const JointLimits& limits, double margin);

  /// Reduces `target_velocity` (rad/s) in place. Returns the reduced joints, bit i for joint i.
  /// Real-time safe.
  unsigned bound(const Interpolator& interpolator, double dt, Vector7& target_velocity) const;

  const Vector7& lower() const { return lower_; }
  const Vector7& upper() const { return upper_; }

 private:
  struct Range {
    double low, high;  // rad
  };
  Range reach(int joint, const AxisState& state, double target, double dt) const;

  Vector7 lower_, upper_, max_velocity_, max_acceleration_, max_jerk_;
};

// Implementation

inline BrakingReach brakingReach(double velocity, double acceleration, double max_acceleration,
                                 double max_jerk) {
  return brakingReach(velocity, acceleration,
                      planVelocity(velocity, acceleration, 0.0, max_acceleration, max_jerk));
}

inline BrakingReach brakingReach(double velocity, double acceleration, const AxisProfile& stop) {
  BrakingReach reach;
  reach.end = advance({0.0, velocity, acceleration}, stop, stop.totalTime()).position;
  reach.lowest = std::min(0.0, reach.end);
  reach.highest = std::max(0.0, reach.end);
  // The velocity changes its sign at most once, in the first phase, while the acceleration still
  // has its old direction.
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
  // If the acceleration limit is reached, the equation is quadratic. Otherwise it is cubic in
  // sqrt(v) and solved by Newton's method from above, where it is convex and cannot undershoot.
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

inline LossReserve lossReserve(const AxisState& before, const AxisState& after,
                               const AxisProfile& stop, double dt, double max_jerk) {
  using B = LossBudget;
  // Longest step of a stop from its part `from`..`to` on. An axis slows down once its acceleration
  // is opposite to its motion. Before that, its speed has its maximum where the acceleration is
  // zero.
  const auto longest = [&](const AxisState& from, const AxisState& to) {
    const double step = to.position - from.position;
    const double peak =
        dt * (from.velocity + 0.5 * from.acceleration * std::abs(from.acceleration) / max_jerk);
    return LossReserve{std::max(0.0, from.acceleration < 0.0 ? -peak : -step),
                       std::max(0.0, from.acceleration > 0.0 ? peak : step)};
  };
  LossReserve way{0.0, 0.0};
  const auto lose = [&](int cycles, const LossReserve& step) {
    way.down += cycles * step.down;
    way.up += cycles * step.up;
  };
  // The first window is lost as early as possible: kInARow cycles after each of the first answers.
  const double step = after.position - before.position;
  AxisState last = after;
  for (int answer = 1; answer < B::kPerWindow / B::kInARow; ++answer) {
    const AxisState next = advance(after, stop, answer * dt);
    const LossReserve repeated = longest(last, next);
    if (answer == 1)
      lose(B::kInARow, {std::max(-step, repeated.down), std::max(step, repeated.up)});
    lose(B::kInARow, repeated);
    last = next;
  }
  // The losses of another window can only follow after as many answers as a window contains.
  constexpr int kAnswers = B::kWindow - B::kPerWindow;
  for (int k = kAnswers; (k - 1) * dt < stop.totalTime(); k += kAnswers) {
    const LossReserve repeated =
        longest(advance(after, stop, (k - 1) * dt), advance(after, stop, k * dt));
    lose(B::kPerWindow, {repeated.down + kLossRounding, repeated.up + kLossRounding});
  }
  return way;
}

inline double lostTime(double dt) { return LossBudget::kPerWindow * dt; }

inline BrakingGuard::BrakingGuard(const JointLimits& limits, double margin)
    : lower_(limits.lower_position.array() + (margin + kWireRounding)),
      upper_(limits.upper_position.array() - (margin + kWireRounding)),
      max_velocity_(limits.velocity),
      max_acceleration_(limits.acceleration),
      max_jerk_(limits.jerk) {}

/// Range that one step towards `target` and a stop after it may reach, including losses.
inline BrakingGuard::Range BrakingGuard::reach(int joint, const AxisState& state, double target,
                                               double dt) const {
  const double a = max_acceleration_[joint], j = max_jerk_[joint];
  const AxisState next =
      advance(state, planVelocity(state.velocity, state.acceleration, target, a, j), dt);
  const AxisProfile stop = planVelocity(next.velocity, next.acceleration, 0.0, a, j);
  const BrakingReach way = brakingReach(next.velocity, next.acceleration, stop);
  const LossReserve lost = lossReserve(state, next, stop, dt, j);
  return {next.position + way.lowest - lost.down, next.position + way.highest + lost.up};
}

inline unsigned BrakingGuard::bound(const Interpolator& interpolator, double dt,
                                    Vector7& target_velocity) const {
  unsigned cut = 0;
  for (int i = 0; i < 7; ++i) {
    const AxisState state = interpolator.axis(i);
    double target = std::clamp(target_velocity[i], -max_velocity_[i], max_velocity_[i]);
    target_velocity[i] = target;
    double low = lower_[i], high = upper_[i];
    const auto within = [&](double part) {
      const Range range = reach(i, state, part * target, dt);
      return range.low >= low && range.high <= high;
    };
    if (within(1.0)) continue;

    // If braking at once may exceed a bound, earlier losses have used their reserve, or the joint
    // is outside. Turning away moves no farther than braking.
    const Range braked = reach(i, state, 0.0, dt);
    if (braked.high > high) {
      high = std::numeric_limits<double>::infinity();
      target = std::min(target, 0.0);
    }
    if (braked.low < low) {
      low = -std::numeric_limits<double>::infinity();
      target = std::max(target, 0.0);
    }
    // Largest admissible fraction of the target; 0 is admissible. 20 halvings: 1e-6 of the target.
    double good = 0.0, bad = 1.0;
    if (within(bad)) good = bad;
    for (int step = 0; step < 20 && good < bad; ++step) {
      const double middle = 0.5 * (good + bad);
      (within(middle) ? good : bad) = middle;
    }
    if (good * target == target_velocity[i]) continue;
    target_velocity[i] = good * target;
    cut |= 1U << i;
  }
  return cut;
}

}  // namespace coglab_rt
