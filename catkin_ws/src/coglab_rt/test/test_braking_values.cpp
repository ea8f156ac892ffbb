/// Numbers of the braking guard: what it reckons with, what it keeps, which joints it names, how
/// finely it cuts, and both sides of a range alike.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "coglab_rt/braking.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_rt {
namespace {

TEST(BrakingValues, TheLossesThatAreReckonedWith) {
  EXPECT_EQ(int{LossBudget::kInARow}, 5);
  EXPECT_EQ(int{LossBudget::kPerWindow}, 20);
  EXPECT_EQ(int{LossBudget::kWindow}, 100);
  EXPECT_DOUBLE_EQ(lostTime(0.005), 0.1);
  EXPECT_EQ(kLossRounding, 0.5e-6);
  EXPECT_DOUBLE_EQ(kWireRounding, 1e-5);
}

TEST(BrakingValues, MarginAndRoundingAreKeptFromBothEnds) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.02);
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(guard.lower()[i] - limits.lower_position[i], 0.02001, 1e-12);
    EXPECT_NEAR(limits.upper_position[i] - guard.upper()[i], 0.02001, 1e-12);
  }
}

/// By hand, from v = 1 with A = 10 and J = 500: the limit is reached after 0.02 s, so that the stop
/// takes v/A + A/J = 0.12 s and half of v times that; from 0.05 it is not: v sqrt(v/J).
TEST(BrakingValues, DistancesByHand) {
  EXPECT_NEAR(brakingDistance(1.0, 10.0, 500.0), 0.06, 1e-15);
  EXPECT_NEAR(brakingDistance(0.05, 10.0, 500.0), 0.0005, 1e-15);
  EXPECT_NEAR(brakingSpeed(0.06 + 0.3, 10.0, 500.0, 0.3), 1.0, 1e-12);
  EXPECT_NEAR(brakingSpeed(0.0005 + 0.015, 10.0, 500.0, 0.3), 0.05, 1e-12);
  // 1 rad/s, still speeding up by 5 rad/s^2: to A = 0 in 0.01 s, up to 1.025 rad/s, then the stop.
  const BrakingReach reach = brakingReach(1.0, 5.0, 10.0, 500.0);
  const double rise = 0.01 * (1.0 + 0.01 * (2.5 - 0.01 * 500.0 / 6.0));
  EXPECT_NEAR(reach.end, rise + brakingDistance(1.025, 10.0, 500.0), 1e-12);
  EXPECT_EQ(reach.highest, reach.end);
  EXPECT_EQ(reach.lowest, 0.0);
}

/// Five lost cycles after each of the first four answers, then twenty after each eightieth answer
/// while the stop lasts; each repeats the step of the answer before it.
TEST(BrakingValues, TheReserveByItsSum) {
  const double dt = 0.01, A = 0.5, J = 10.0;
  // From constant speed, and while the axis still speeds up: then each of the first answers counts
  // as the peak that is to come, 1 + 0.4^2 / (2 J), over one cycle.
  for (const double acceleration : {0.0, 0.4}) {
    const AxisState after{0.3, 1.0, acceleration};
    const AxisProfile stop = planVelocity(after.velocity, after.acceleration, 0.0, A, J);
    ASSERT_GT(stop.totalTime(), 1.59);
    ASSERT_LT(stop.totalTime(), 2.39);
    const auto step = [&](int k) {
      return advance(after, stop, k * dt).position - advance(after, stop, (k - 1) * dt).position;
    };
    const double later = 20 * (step(80) + step(160) + 2 * kLossRounding);
    for (const double seen : {0.0099, 0.02}) {  // way of the answer that the controller saw last
      const double first = acceleration > 0.0 ? 1.008 * dt : step(1);
      const double early = acceleration > 0.0 ? 3 * first : step(1) + step(2) + step(3);
      const AxisState before{0.3 - seen, 1.0, acceleration};
      const LossReserve up = lossReserve(before, after, stop, dt, J);
      EXPECT_NEAR(up.up, 5 * (std::max(seen, first) + early) + later, 1e-12);
      EXPECT_NEAR(up.down, 20 * 2 * kLossRounding, 1e-12);
      const AxisProfile back = planVelocity(-1.0, -acceleration, 0.0, A, J);
      const LossReserve down = lossReserve({-before.position, -1.0, -acceleration},
                                           {-0.3, -1.0, -acceleration}, back, dt, J);
      EXPECT_NEAR(down.down, up.up, 1e-12);
      EXPECT_NEAR(down.up, up.down, 1e-12);
    }
  }
}

/// One joint near an end, the others in the middle of their ranges: bit i names it and no other.
class OneJoint : public ::testing::TestWithParam<int> {
 protected:
  const int joint_ = GetParam();
  const JointLimits limits_ = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard_{limits_, 0.05};
  Interpolator interpolator_{limits_};
};

TEST_P(OneJoint, AloneIsCutAndNamed) {
  for (const double side : {-1.0, 1.0}) {
    Vector7 position = Vector7::Zero(), target = Vector7::Constant(0.4 * side);
    position[joint_] = side * (guard_.upper()[joint_] - 1e-5);
    interpolator_.reset(position);
    EXPECT_EQ(guard_.bound(interpolator_, 0.005, target), 1U << joint_);
    for (int i = 0; i < 7; ++i) {
      if (i == joint_) {
        EXPECT_LT(std::abs(target[i]), 0.4);
      } else {
        EXPECT_EQ(target[i], 0.4 * side);
      }
    }
  }
}

TEST_P(OneJoint, OutsideStandsOrComesBackUncut) {
  for (const double side : {-1.0, 1.0}) {
    Vector7 position = Vector7::Zero();
    position[joint_] = side * (guard_.upper()[joint_] + 0.02);
    interpolator_.reset(position);
    Vector7 target = Vector7::Zero();
    target[joint_] = 0.3 * side;
    EXPECT_EQ(guard_.bound(interpolator_, 0.005, target), 1U << joint_);
    EXPECT_EQ(target[joint_], 0.0);
    target[joint_] = -0.3 * side;
    EXPECT_EQ(guard_.bound(interpolator_, 0.005, target), 0U);
    EXPECT_EQ(target[joint_], -0.3 * side);
  }
}

INSTANTIATE_TEST_SUITE_P(EachOf, OneJoint, ::testing::Range(0, 7));

TEST(BrakingValues, ATargetBeyondTheSpeedOfAJointIsItsSpeedAndNoCut) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.0);
  Interpolator interpolator(limits);
  for (const double side : {-1.0, 1.0}) {
    Vector7 target = Vector7::Constant(50.0 * side);
    EXPECT_EQ(guard.bound(interpolator, 0.005, target), 0U);
    EXPECT_EQ(target, side * limits.velocity);
  }
}

/// 20 halvings: what is let through of a target is a whole number of 2^-20 of it, odd ones too, and
/// one more of them would pass the bound.
TEST(BrakingValues, WhatIsLetThroughIsAWholeNumberOfTwentyHalvings) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  const BrakingGuard guard(limits, 0.0);
  Interpolator interpolator(limits);
  int cut = 0, odd = 0;
  for (double left = 1e-4; left < 0.1; left *= 1.1) {
    interpolator.reset(guard.upper() - Vector7::Constant(left));
    Vector7 target = Vector7::Ones();
    if (guard.bound(interpolator, 0.1, target) != 0x7FU) continue;
    const double parts = std::ldexp(target[0], 20);
    ASSERT_EQ(parts, std::floor(parts)) << left;
    ++cut;
    odd += std::fmod(parts, 2.0) == 1.0 ? 1 : 0;
    Vector7 more = Vector7::Constant(std::ldexp(parts + 1.0, -20));
    EXPECT_NE(guard.bound(interpolator, 0.1, more) & 1U, 0U) << left;
  }
  EXPECT_GT(cut, 20);
  EXPECT_GT(odd, 3);
}

}  // namespace
}  // namespace coglab_rt
