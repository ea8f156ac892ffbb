/// Braking distance and the resulting bound on velocities: no position limit is crossed from any
/// state in which braking is still possible.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "coglab_rt/braking.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_rt {
namespace {

TEST(Braking, ReachEqualsTheSampledStop) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  for (int i = 0; i < 3000; ++i) {
    const double A = 10.0, J = 500.0, v = 2.0 * part(random), a = A * part(random);
    const AxisProfile stop = planVelocity(v, a, 0.0, A, J);
    double lowest = 0.0, highest = 0.0;
    for (int k = 0; k <= 2000; ++k) {
      const double p = advance({0.0, v, a}, stop, stop.totalTime() * k / 2000.0).position;
      lowest = std::min(lowest, p);
      highest = std::max(highest, p);
    }
    const BrakingReach reach = brakingReach(v, a, A, J);
    ASSERT_NEAR(reach.lowest, lowest, 1e-6) << v << " " << a;
    ASSERT_NEAR(reach.highest, highest, 1e-6) << v << " " << a;
    ASSERT_LE(reach.lowest, lowest + 1e-15);
    ASSERT_GE(reach.highest, highest - 1e-15);
  }
}

TEST(Braking, DistanceAndSpeedAreInverse) {
  for (const double A : {0.5, 10.0}) {
    for (const double J : {10.0, 500.0}) {
      for (const double delay : {0.0, 0.001, 0.1}) {
        for (double v = 1e-4; v < 3.0; v *= 1.3) {
          EXPECT_NEAR(brakingDistance(v, A, J), brakingReach(v, 0.0, A, J).end, 1e-12);
          const double distance = delay * v + brakingDistance(v, A, J);
          EXPECT_NEAR(brakingSpeed(distance, A, J, delay), v, 1e-9 * (1.0 + v));
        }
      }
    }
  }
  EXPECT_EQ(brakingSpeed(0.0, 10.0, 500.0, 0.0), 0.0);
  EXPECT_EQ(brakingSpeed(-1.0, 10.0, 500.0, 0.0), 0.0);
}

/// 10 000 random states per tick length, each joint driven at top speed towards one of its limits.
TEST(Braking, NoPositionLimitIsCrossedFromAnyState) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.0);
  std::mt19937 random(17);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  int states = 0, at_border = 0;
  for (const double dt : {0.001, 0.005, 0.020}) {
    for (int trial = 0; trial < 10000 / 7 / 3 + 1; ++trial) {
      Vector7 p, v, a;
      for (int i = 0; i < 7; ++i) {
        do {  // states from which braking at once stays inside; the others are lost for any guard
          p[i] = limits.upper_position[i] * part(random);
          v[i] = limits.velocity[i] * part(random);
          a[i] = limits.acceleration[i] * part(random);
          const BrakingReach reach =
              brakingReach(v[i], a[i], limits.acceleration[i], limits.jerk[i]);
          const double peak = v[i] + a[i] * std::abs(a[i]) / (2.0 * limits.jerk[i]);
          if (std::abs(peak) <= limits.velocity[i] &&
              p[i] + reach.highest <= limits.upper_position[i] &&
              p[i] + reach.lowest >= limits.lower_position[i]) {
            break;
          }
        } while (true);
        ++states;
      }
      Interpolator interpolator(limits);
      interpolator.resume(p, v, a);
      Vector7 wanted;
      for (int i = 0; i < 7; ++i) wanted[i] = part(random) > 0.0 ? 10.0 : -10.0;
      for (int step = 0; step < static_cast<int>(4.5 / dt) && step < 900; ++step) {
        Vector7 target = wanted;
        const unsigned cut = guard.bound(interpolator, dt, target);
        at_border += cut != 0 ? 1 : 0;
        interpolator.step(target, dt);
        for (int i = 0; i < 7; ++i) {
          ASSERT_LE(interpolator.position()[i], limits.upper_position[i] + 1e-9)
              << i << " dt " << dt;
          ASSERT_GE(interpolator.position()[i], limits.lower_position[i] - 1e-9)
              << i << " dt " << dt;
        }
      }
    }
  }
  EXPECT_GE(states, 10000);
  EXPECT_GT(at_border, 10000);
}

/// One axis that follows an answer and then brakes; losses within the budget, random or as early as
/// possible.
TEST(Braking, TheReserveCoversAllLossesInTheBudget) {
  using B = LossBudget;
  std::mt19937 random(23);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  double tightest = 1.0;  // rad between what was reserved and reached
  for (const double dt : {0.001, 0.002, 0.005, 0.010, 0.020, 0.100}) {
    for (int trial = 0; trial < 4000; ++trial) {
      const bool slow = trial % 4 == 0;  // limits of the profile t1: stops of several windows
      const double A = slow ? 0.5 : 10.0, J = slow ? 10.0 : 500.0;
      const AxisState before{0.0, (slow ? 0.25 : 2.0) * part(random), A * part(random)};
      const double target = trial % 3 == 0 ? 0.0 : (slow ? 0.25 : 2.0) * part(random);
      const AxisState after =
          advance(before, planVelocity(before.velocity, before.acceleration, target, A, J), dt);
      const AxisProfile stop = planVelocity(after.velocity, after.acceleration, 0.0, A, J);
      const BrakingReach reach = brakingReach(after.velocity, after.acceleration, A, J);
      const LossReserve reserve = lossReserve(before, after, stop, dt, J);
      const double chance = trial % 2 == 0 ? 1.0 : 0.5 * (1.0 + part(random));
      std::deque<bool> window(B::kWindow - 1, false);
      int lost = 0, in_a_row = 0, answers = 0;
      double q = after.position, step = after.position - before.position;
      double highest = q, lowest = q;
      while (answers * dt < stop.totalTime() + dt || in_a_row > 0) {
        const bool lose =
            in_a_row < B::kInARow && lost < B::kPerWindow && 0.5 * (1.0 + part(random)) <= chance;
        if (!lose) {
          step = advance(after, stop, (answers + 1) * dt).position -
                 advance(after, stop, answers * dt).position;
          ++answers;
        }
        q += step;
        highest = std::max(highest, q);
        lowest = std::min(lowest, q);
        in_a_row = lose ? in_a_row + 1 : 0;
        window.push_back(lose);
        lost += (lose ? 1 : 0) - (window.front() ? 1 : 0);
        window.pop_front();
      }
      const double above = after.position + reach.highest + reserve.up - highest;
      const double below = lowest - (after.position + reach.lowest - reserve.down);
      ASSERT_GE(above, -1e-12) << dt << " " << trial;
      ASSERT_GE(below, -1e-12) << dt << " " << trial;
      if (before.velocity > 0.5) tightest = std::min(tightest, above);
    }
  }
  EXPECT_LT(tightest, 1e-9);  // nothing is given away where the losses come first
}

/// BrakingGuard in states where braking at once may exceed a bound: no step towards the bound is
/// longer than the same step of the stop.
TEST(Braking, TurningAwayGoesNoFartherThanBraking) {
  std::mt19937 random(29);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  const double A = 10.0, J = 500.0;
  for (int trial = 0; trial < 40000; ++trial) {
    const double dt = std::pow(10.0, -2.0 + part(random)), v = 2.0 * part(random);
    const double a = A * part(random), target = -1.0 - part(random);
    const AxisProfile stop = planVelocity(v, a, 0.0, A, J);
    const AxisState turned = advance({0.0, v, a}, planVelocity(v, a, target, A, J), dt);
    const AxisProfile later = planVelocity(turned.velocity, turned.acceleration, 0.0, A, J);
    double last = 0.0, last_turned = 0.0;
    for (int k = 1; (k - 1) * dt < stop.totalTime() + dt && k < 400; ++k) {
      const double q = advance({0.0, v, a}, stop, k * dt).position;
      const double q_turned = advance(turned, later, (k - 1) * dt).position;
      ASSERT_LE(q_turned - last_turned, std::max(0.0, q - last) + 1e-12)
          << v << " " << a << " " << dt;
      last = q;
      last_turned = q_turned;
    }
  }
}

TEST(Braking, StandsAtTheBorderAndComesBack) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.01);
  Interpolator interpolator(limits);
  interpolator.reset(limits.upper_position - Vector7::Constant(0.5));
  for (int step = 0; step < 3000; ++step) {
    Vector7 target = limits.velocity;
    guard.bound(interpolator, 0.002, target);
    interpolator.step(target, 0.002);
  }
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(interpolator.position()[i], guard.upper()[i], 1e-4);
    EXPECT_NEAR(interpolator.velocity()[i], 0.0, 1e-3);
  }
  for (int step = 0; step < 500; ++step) {
    Vector7 target = Vector7::Constant(-0.3);
    EXPECT_EQ(guard.bound(interpolator, 0.002, target), 0U);
    interpolator.step(target, 0.002);
  }
  EXPECT_LT(interpolator.position()[0], guard.upper()[0] - 0.2);
}

TEST(Braking, AJointOutsideMayOnlyComeBack) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.05);
  Interpolator interpolator(limits);
  const Vector7 outside = limits.upper_position - Vector7::Constant(0.02);
  interpolator.reset(outside);
  for (int step = 0; step < 200; ++step) {
    Vector7 target = Vector7::Constant(0.5);
    guard.bound(interpolator, 0.005, target);
    interpolator.step(target, 0.005);
    ASSERT_LE(interpolator.position()[0], outside[0] + 1e-9);
  }
  for (int step = 0; step < 200; ++step) {
    Vector7 target = Vector7::Constant(-0.5);
    guard.bound(interpolator, 0.005, target);
    interpolator.step(target, 0.005);
  }
  EXPECT_LT(interpolator.position()[0], outside[0] - 0.3);
}

TEST(Braking, TheWayToTheBorderIsSmooth) {
  // No chatter: on the way in, the acceleration changes its direction of change only a few times.
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.0);
  Interpolator interpolator(limits);
  interpolator.reset(Vector7::Zero());
  int turns = 0;
  double last_change = 0.0;
  for (int step = 0; step < 3000; ++step) {
    Vector7 target = Vector7::Zero();
    target[0] = 5.0;
    const double before = interpolator.acceleration()[0];
    guard.bound(interpolator, 0.001, target);
    interpolator.step(target, 0.001);
    const double change = interpolator.acceleration()[0] - before;
    if (std::abs(change) > 0.05 && change * last_change < 0.0) ++turns;
    if (std::abs(change) > 0.05) last_change = change;
  }
  EXPECT_LE(turns, 6);
}

}  // namespace
}  // namespace coglab_rt
