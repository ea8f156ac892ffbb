/// @file
/// Velocity bounds from braking distance: whatever a source asks for, every joint can always be
/// stopped before its position limits, within its acceleration and jerk limits.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "coglab_rt/interpolator.hpp"

namespace coglab_rt {

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

/// The same along that stop's profile.
BrakingReach brakingReach(double velocity, double acceleration, const AxisProfile& stop);

/// Distance of the stop from constant speed (rad/s, >= 0), acceleration 0: v/2 (v/A + A/J), or v
/// sqrt(v/J) where the acceleration limit is not reached.
double brakingDistance(double speed, double max_acceleration, double max_jerk);

/// Highest constant speed (rad/s) from which an axis stops within `distance` (rad) after going on
/// at that speed for `delay` (s): inverse of delay*v + brakingDistance(v). 0 for distance <= 0. For
/// guards that plan with margins, such as the controller manager's; the bridge itself looks one
/// tick ahead with the exact state (BrakingGuard).
double brakingSpeed(double distance, double max_acceleration, double max_jerk, double delay);

/// The cycles without an answer that a back end reckons with, at every period: as many as a robot
/// controller rides through before it ends command mode (coglab_sim's figures; makers publish
/// none). docs/limits_under_loss.md says why the limits hold.
struct LossBudget {
  static constexpr int kInARow = 5;
  static constexpr int kPerWindow = 20;  ///< of any kWindow cycles: quality UNACCEPTABLE
  static constexpr int kWindow = 100;
};

/// What lost cycles may add to the way of a stop, rad, both >= 0.
struct LossReserve {
  double down, up;
};

/// Way that an axis may make in lost cycles of `dt` (s), an upper bound over all losses within the
/// LossBudget: the answer that the controller saw last led it from `before` to `after`, each answer
/// from then on brakes at once along `stop`, and each lost cycle repeats the step of the answer
/// before it. The way of the answers themselves is brakingReach's. Real-time safe.
LossReserve lossReserve(const AxisState& before, const AxisState& after, const AxisProfile& stop,
                        double dt, double max_jerk);

/// Time (s) of constant speed that is at least what lossReserve keeps of one window of the
/// LossBudget at period `dt` (s) of the arm's interface: what whoever plans a motion keeps before a
/// limit, so that the bridge's own guard finds nothing to cut while no cycles or single ones are
/// lost. Bursts of losses at full speed and long periods use up more before the plan hears of them;
/// there that guard does cut, see docs/limits_under_loss.md. Real-time safe.
double lostTime(double dt);

/// Rounding on the wire to the arm (float32 at 3 rad) that one lost cycle can add, rad: 0.24e-6 by
/// the step that is repeated, both its ends, and 0.24e-6 by the set-point that is reported after
/// it.
constexpr double kLossRounding = 0.5e-6;

/// What BrakingGuard keeps before a bound besides the margin, rad: the rounding of one window of
/// lost cycles.
constexpr double kWireRounding = LossBudget::kPerWindow * kLossRounding;

/// Bounds target velocities so that the interpolator's next step leaves every joint able to stop
/// inside its position limits whatever is lost within the LossBudget. A joint for which even
/// braking at once leaves that open, such as one that is outside already, brakes at once or turns
/// away from the limit.
class BrakingGuard {
 public:
  /// `margin` (rad) is kept from both ends of every range; it must leave room between them.
  /// Besides, kWireRounding is kept.
  BrakingGuard(const JointLimits& limits, double margin);

  /// Cuts `target_velocity` (rad/s) in place and returns the joints that were cut, bit i for joint
  /// i. Real-time safe.
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

inline LossReserve lossReserve(const AxisState& before, const AxisState& after,
                               const AxisProfile& stop, double dt, double max_jerk) {
  using B = LossBudget;
  // Longest step of a stop from its part `from`..`to` on. An axis slows down once its acceleration
  // points against its motion; until then its speed peaks where the acceleration comes to zero.
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
  // The first window is lost as early as it can be: kInARow cycles after each of the first answers.
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
  // Another window's losses can only come after as many answers as a window has.
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

/// What one step towards `target` and a stop after it may reach, losses included.
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

    // Where braking at once may pass a bound, losses before it have used what was kept for them, or
    // the joint is outside; turning away goes no farther than braking does.
    const Range braked = reach(i, state, 0.0, dt);
    if (braked.high > high) {
      high = std::numeric_limits<double>::infinity();
      target = std::min(target, 0.0);
    }
    if (braked.low < low) {
      low = -std::numeric_limits<double>::infinity();
      target = std::max(target, 0.0);
    }
    // Largest admissible part of the target; 0 is admissible. 20 halvings: 1e-6 of the target.
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
