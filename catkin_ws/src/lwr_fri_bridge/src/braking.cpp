#include "lwr_fri_bridge/braking.hpp"

#include <algorithm>
#include <cmath>

namespace lwr_fri_bridge {

BrakingReach brakingReach(double velocity, double acceleration, double max_acceleration,
                          double max_jerk) {
  const AxisProfile stop = planVelocity(velocity, acceleration, 0.0, max_acceleration, max_jerk);
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

double brakingDistance(double speed, double max_acceleration, double max_jerk) {
  if (speed * max_jerk < max_acceleration * max_acceleration)
    return speed * std::sqrt(speed / max_jerk);
  return 0.5 * speed * (speed / max_acceleration + max_acceleration / max_jerk);
}

double brakingSpeed(double distance, double max_acceleration, double max_jerk, double delay) {
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

BrakingGuard::BrakingGuard(const JointLimits& limits, double margin)
    : lower_(limits.lower_position.array() + margin),
      upper_(limits.upper_position.array() - margin),
      max_velocity_(limits.velocity),
      max_acceleration_(limits.acceleration),
      max_jerk_(limits.jerk) {}

bool BrakingGuard::admissible(int joint, const AxisState& state, double target, double dt,
                              double low, double high) const {
  const double a = max_acceleration_[joint], j = max_jerk_[joint];
  const AxisProfile profile = planVelocity(state.velocity, state.acceleration, target, a, j);
  const AxisState next = advance(state, profile, dt);
  const BrakingReach reach = brakingReach(next.velocity, next.acceleration, a, j);
  const double delay = next.velocity * dt;  // one cycle that passes before braking can begin
  return next.position + reach.highest + std::max(0.0, delay) <= high &&
         next.position + reach.lowest + std::min(0.0, delay) >= low;
}

unsigned BrakingGuard::bound(const Interpolator& interpolator, double dt,
                             Vector7& target_velocity) const {
  unsigned cut = 0;
  for (int i = 0; i < 7; ++i) {
    const AxisState state = interpolator.axis(i);
    const double target = std::clamp(target_velocity[i], -max_velocity_[i], max_velocity_[i]);
    target_velocity[i] = target;
    if (admissible(i, state, target, dt, lower_[i], upper_[i])) continue;

    // What braking at once would reach is unavoidable; a joint outside its range must still be
    // allowed to come back.
    const double a = max_acceleration_[i], j = max_jerk_[i];
    const AxisState braked =
        advance(state, planVelocity(state.velocity, state.acceleration, 0.0, a, j), dt);
    const BrakingReach reach = brakingReach(braked.velocity, braked.acceleration, a, j);
    const double delay = braked.velocity * dt;
    const double tiny = 1e-12;
    const double high =
        std::max(upper_[i], braked.position + reach.highest + std::max(0.0, delay) + tiny);
    const double low =
        std::min(lower_[i], braked.position + reach.lowest + std::min(0.0, delay) - tiny);
    if (admissible(i, state, target, dt, low, high) && (low < lower_[i] ? target >= 0.0 : true) &&
        (high > upper_[i] ? target <= 0.0 : true)) {
      continue;
    }
    // Largest admissible part of the target; 0 is admissible by construction. 30 halvings: 1e-9 of
    // the target.
    double good = 0.0, bad = 1.0;
    for (int step = 0; step < 30; ++step) {
      const double middle = 0.5 * (good + bad);
      (admissible(i, state, middle * target, dt, low, high) ? good : bad) = middle;
    }
    target_velocity[i] = good * target;
    cut |= 1U << i;
  }
  return cut;
}

}  // namespace lwr_fri_bridge
