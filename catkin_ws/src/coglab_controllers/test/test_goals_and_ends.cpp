// What the cores do exactly at their limits: which goals are believed, what counts as noise, when a
// motion ends, how a goal is drawn back, and what a roll-out covers.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "coglab_controllers/dmp/roll_out.hpp"
#include "coglab_controllers/goal/goal_gate.hpp"
#include "coglab_controllers/goal/goal_relay.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/limits/guard.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

constexpr double kCycle = 0.005, kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kSecond = 1'000'000'000, kMs = 1'000'000;
using State = GoalGate::State;

GoalObservation sight(double x, std::int64_t frame_ns) {
  GoalObservation seen;
  seen.position = Vector3(x, 0.0, 0.0);
  seen.frame_ns = seen.stamp_ns = frame_ns;
  return seen;
}

GoalGate begun(double x = 1.0, const GoalGateParameters& parameters = {}) {
  GoalGate gate(parameters);
  gate.reset(sight(x, kSecond));
  return gate;
}

CartesianMotionPlan reachPlan(double duration = 1.0) {
  LearningOptions options;
  options.allow = {"brief"};
  const Primitive p =
      learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), duration)}, options);
  return {TransformationSystem(p), 1.0, true};
}

}  // namespace

TEST(GoalGate, AFrameIsFollowedUpToItsJumpAndItsAge) {
  GoalGate gate = begun();
  EXPECT_EQ(gate.state(), State::Fresh);
  EXPECT_EQ(gate.age(), 0.0);
  EXPECT_EQ(gate.jump(), 0.0);
  EXPECT_EQ(gate.update(kSecond + 10 * kMs, sight(1.1499, kSecond + 5 * kMs)), State::Fresh);
  EXPECT_NEAR(gate.jump(), 0.1499, 1e-12);
  EXPECT_NEAR(gate.age(), 0.005, 1e-12);
  EXPECT_EQ(gate.goal().position.x(), 1.1499);
  EXPECT_EQ(gate.update(kSecond + 10 * kMs, sight(1.3001, kSecond + 10 * kMs)), State::Jumped);
  EXPECT_NEAR(gate.jump(), 0.1502, 1e-12);
  EXPECT_EQ(gate.goal().position.x(), 1.1499);
  EXPECT_EQ(gate.update(kSecond + 20 * kMs, sight(1.1, kSecond + 20 * kMs)), State::Fresh);
  const GoalObservation last = sight(1.1, kSecond + 20 * kMs);
  EXPECT_EQ(gate.update(kSecond + 219 * kMs, last), State::Fresh);
  EXPECT_EQ(gate.update(kSecond + 221 * kMs, last), State::Old);
  EXPECT_EQ(gate.update(kSecond + 1019 * kMs, last), State::Old);
  EXPECT_EQ(gate.update(kSecond + 1021 * kMs, last), State::Lost);
  EXPECT_EQ(gate.update(kSecond + 1030 * kMs, sight(1.1, kSecond + 1030 * kMs)), State::Fresh);
}

TEST(GoalGate, ThreeFramesThatAgreeWithinFiftyMillimetresAreBelieved) {
  for (const double apart : {0.049, 0.051}) {
    GoalGate gate = begun(0.0);
    for (int i = 0; i < 3; ++i) {
      const std::int64_t t = kSecond + (i + 1) * kMs;
      const State expected = i == 2 && apart < 0.05 ? State::Fresh : State::Jumped;
      EXPECT_EQ(gate.update(t, sight(0.5 + apart * i, t)), expected) << apart << " " << i;
      EXPECT_EQ(gate.update(t, sight(0.5 + apart * i, t)), expected) << "a frame counts once";
    }
  }
  // A frame near the goal between them begins the count anew.
  GoalGate gate = begun(0.0);
  const double places[] = {0.5, 0.5, 0.0, 0.5, 0.5};
  for (int i = 0; i < 5; ++i) gate.update(kSecond + i, sight(places[i], kSecond + i + 1));
  EXPECT_EQ(gate.state(), State::Jumped);
  EXPECT_EQ(gate.goal().position.x(), 0.0);
}

TEST(GoalGate, WhatIsExactlyAtALimitIsWithinIt) {
  GoalGateParameters exact;  // numbers that a computer has exactly
  exact.max_jump = 0.25;
  exact.agreement = 0.125;
  exact.max_age = 0.5;
  GoalGate gate = begun(1.0, exact);
  EXPECT_EQ(gate.update(kSecond + 1, sight(1.25, kSecond + 1)), State::Fresh);
  EXPECT_EQ(gate.goal().position.x(), 1.25);
  for (int i = 0; i < 3; ++i) gate.update(kSecond + 2 + i, sight(2.0 + 0.125 * i, kSecond + 2 + i));
  EXPECT_EQ(gate.state(), State::Fresh);
  EXPECT_EQ(gate.goal().position.x(), 2.25);
  const GoalObservation last = sight(2.25, 2 * kSecond);
  EXPECT_EQ(gate.update(2 * kSecond + 500 * kMs, last), State::Fresh);
  EXPECT_EQ(gate.update(2 * kSecond + 500 * kMs + 1, last), State::Old);
}

TEST(GoalGate, FramesThatJumpForASecondAreALostGoal) {
  GoalGate gate = begun(0.0);
  for (int i = 1; i <= 100; ++i) {
    const std::int64_t t = kSecond + 10 * kMs * i;
    EXPECT_EQ(gate.update(t, sight(i % 2 == 0 ? 1.0 : -1.0, t)), State::Jumped) << i;
  }
  EXPECT_EQ(gate.update(kSecond + 1001 * kMs, sight(1.0, kSecond + 1001 * kMs)), State::Lost);
}

TEST(GoalGate, WithoutALimitAGoalStaysValidOrIsNeverLost) {
  GoalGateParameters forever;
  forever.max_age = 0.0;
  GoalGate gate = begun(1.0, forever);
  EXPECT_EQ(gate.update(1000 * kSecond, sight(1.0, kSecond)), State::Fresh);
  GoalGateParameters never;
  never.lost_time = 0.0;
  gate = begun(1.0, never);
  EXPECT_EQ(gate.update(1000 * kSecond, sight(1.0, kSecond)), State::Old);
}

TEST(GoalGate, UntilAMotionBeginsThreeFramesAreNeededWhereverTheyAre) {
  GoalGate gate;
  EXPECT_EQ(gate.state(), State::Unsettled);
  for (int i = 1; i <= 3; ++i) {
    EXPECT_EQ(gate.update(i * kMs, sight(0.0, i * kMs)), i < 3 ? State::Unsettled : State::Fresh);
  }
  GoalGate still;  // a static frame, here at the origin, is believed at once
  GoalObservation turned = sight(0.0, 0);
  turned.stamp_ns = kSecond;
  EXPECT_EQ(still.update(kSecond, turned), State::Fresh);
  turned.orientation = expRotation(Vector3(0.0, 0.0, 0.4));
  EXPECT_EQ(still.update(kSecond, turned), State::Fresh);
  EXPECT_LT(still.goal().orientation.angularDistance(turned.orientation), 1e-9);
  turned.stamp_ns = 5 * kSecond;  // and is as young as it was last seen
  EXPECT_EQ(still.update(5 * kSecond + 100 * kMs, turned), State::Fresh);
  EXPECT_NEAR(still.age(), 0.1, 1e-9);
}

TEST(GoalGate, AFrameIsLaterByItsStampOrByAStepOfItsClock) {
  GoalObservation one = sight(0.0, 100), other = sight(0.0, 100);
  EXPECT_FALSE(one.isLaterThan(other));
  other.frame_ns = 99;
  EXPECT_TRUE(one.isLaterThan(other));
  EXPECT_FALSE(other.isLaterThan(one));
  other.clock_steps = 1;
  EXPECT_TRUE(other.isLaterThan(one));
  const GoalGateParameters standard;
  EXPECT_EQ(standard.max_age, 0.2);
  EXPECT_EQ(standard.max_jump, 0.15);
  EXPECT_EQ(standard.frames_to_accept, 3);
  EXPECT_EQ(standard.agreement, 0.05);
  EXPECT_EQ(standard.lost_time, 1.0);
}

TEST(GoalJitter, IsTheMeanSquareOfTheThirdDifferencesOverAThirdOfASecond) {
  GoalJitter jitter(1.0);
  EXPECT_EQ(jitter.speed(), 0.0);
  const double steps[] = {0.1, 0.0, 0.1, 0.0};
  double power = 0.0;
  for (int i = 0; i < 4; ++i) {
    jitter.see(0.03, Vector3(0.0, steps[i], 0.0));
    power *= std::exp(-0.03 / 0.35);
    if (i >= 2) {
      power += std::pow(steps[i] - 2.0 * steps[i - 1] + steps[i - 2], 2) / 6.0 / 0.35;
    }
    EXPECT_NEAR(jitter.speed(), std::sqrt(5.0 * power), 1e-12) << i;
    jitter.wait(0.01);
    power *= std::exp(-0.01 / 0.35);
    EXPECT_NEAR(jitter.share(), std::sqrt(5.0 * power), 1e-12) << i;
  }
  GoalJitter leaps(0.2);  // no frame counts for more than full noise
  for (const double step : {0.0, 0.0, 5.0}) leaps.see(0.0, Vector3(step, 0.0, 0.0));
  EXPECT_NEAR(leaps.speed(), 0.2, 1e-12);
  EXPECT_NEAR(leaps.share(), 1.0, 1e-12);
  leaps.reset();
  EXPECT_EQ(leaps.share(), 0.0);
  leaps.see(0.0, Vector3(5.0, 0.0, 0.0));
  leaps.see(0.0, Vector3(-5.0, 0.0, 0.0));
  EXPECT_EQ(leaps.share(), 0.0) << "two steps tell nothing";
}

/// Part of a rate that is more than noise of `noisy`.
double beyond(double rate, double noisy) {
  const double power = std::pow(rate / noisy, 8);
  return rate * power / (1.0 + power);
}

TEST(GoalEstimator, ANoisyGoalIsFollowedMoreSlowlyAndOnlyByWhatIsMoreThanNoise) {
  for (const double noise : {0.0, 0.5, 1.0, 3.0}) {
    for (const bool predicted : {false, true}) {
      GoalEstimator estimator;
      estimator.reset(Vector3::Zero());
      // The time constant goes to its new value within 0.3 s.
      for (int i = 0; i < 2000; ++i) estimator.update(kCycle, Vector3::Zero(), noise, predicted);
      const double part = std::min(noise, 1.0), k = 1.0 / (0.06 + part * 0.04);
      const double noisy = std::max(part * 0.04, predicted ? 0.08 : 0.0);
      for (int i = 1; i < 150; ++i) {
        estimator.update(kCycle, Vector3(0.02, 0, 0), noise, predicted);
        const double t = k * i * kCycle, rate = 0.5 * 0.02 * k * t * t * std::exp(-t);
        const double told = noisy > 0.0 ? beyond(rate, noisy) : rate;
        ASSERT_NEAR(estimator.velocity().x(), told, 1e-6) << noise << predicted << " " << i;
        const double way = 0.02 * (1.0 - (1.0 + t + 0.5 * t * t) * std::exp(-t));
        ASSERT_NEAR(estimator.position().x(), way + 3.0 / k * told, 1e-6);
      }
    }
  }
}

TEST(OrientationEstimator, ANoisyTurnIsFollowedMoreSlowlyAndOnlyByWhatIsMoreThanNoise) {
  for (const double noise : {0.0, 1.0}) {
    OrientationEstimator estimator;
    estimator.reset(Quaternion::Identity());
    const auto turned = [](double angle) { return expRotation(Vector3(0.0, 0.0, angle)); };
    for (int i = 0; i < 2000; ++i) estimator.update(kCycle, turned(0.0), noise);
    const double k = 1.0 / (noise > 0.0 ? 0.30 : 0.06);
    for (int i = 1; i < 150; ++i) {
      estimator.update(kCycle, turned(0.5), noise);
      const double t = k * i * kCycle, rate = 0.5 * 0.5 * k * t * t * std::exp(-t);
      const double told = noise > 0.0 ? beyond(rate, 2.0) : rate;
      ASSERT_NEAR(estimator.angularVelocity().z(), told, 1e-5) << noise << " " << i;
      const double way = 0.5 * (1.0 - (1.0 + t + 0.5 * t * t) * std::exp(-t));
      ASSERT_NEAR(estimator.orientation().angularDistance(turned(way + 3.0 / k * told)), 0.0, 1e-5);
    }
    const Quaternion still = estimator.orientation();
    estimator.update(0.0, turned(2.0), noise);
    EXPECT_EQ(estimator.orientation().coeffs(), still.coeffs());
  }
  OrientationEstimator at_limit, farther;  // 0.6 rad away or more pulls the same
  at_limit.update(kCycle, expRotation(Vector3(0.6, 0.0, 0.0)));
  farther.update(kCycle, expRotation(Vector3(2.0, 0.0, 0.0)));
  EXPECT_LT((at_limit.angularVelocity() - farther.angularVelocity()).norm(), 1e-12);
  GoalEstimatorParameters off;
  off.time_constant = 0.0;
  OrientationEstimator plain(off);
  plain.update(kCycle, expRotation(Vector3(2.0, 0.0, 0.0)));
  EXPECT_LT(plain.orientation().angularDistance(expRotation(Vector3(2.0, 0.0, 0.0))), 1e-9);
  EXPECT_TRUE(plain.angularVelocity().isZero(0.0));
}

TEST(GoalEstimator, EachParameterHasItsRange) {
  using P = GoalEstimatorParameters;
  const struct {
    double P::*field;
    std::vector<double> fine, bad;
  } cases[] = {
      {&P::noisy_time_constant, {0.005, 2.0}, {0.0, 0.0049, 2.001, kNan}},
      {&P::noisy_turning_time_constant, {0.005, 2.0}, {0.0, 0.0049, 2.001, kNan}},
      {&P::noisy_speed, {0.0, 9.0}, {-1e-9, INFINITY, kNan}},
      {&P::noisy_turning, {0.0, 9.0}, {-1e-9, INFINITY, kNan}},
      {&P::predicted_speed, {0.0, 9.0}, {-1e-9, INFINITY, kNan}},
      {&P::max_speed, {1e-9, 9.0}, {0.0, -1.0, INFINITY, kNan}},
      {&P::max_innovation, {1e-9, 9.0}, {0.0, -1.0, INFINITY, kNan}},
      {&P::max_angle_innovation, {1e-9, 3.1}, {0.0, -1.0, 3.101, kNan}},
      {&P::time_constant, {0.0, 0.005, 2.0}, {-0.1, 0.0049, 2.001, kNan}},
  };
  int number = 0;
  for (const auto& c : cases) {
    ++number;
    P parameters;
    for (const double fine : c.fine) {
      parameters.*c.field = fine;
      EXPECT_NO_THROW(GoalEstimator{parameters}) << number << ": " << fine;
      EXPECT_NO_THROW(OrientationEstimator{parameters}) << number << ": " << fine;
    }
    for (const double bad : c.bad) {
      parameters.*c.field = bad;
      EXPECT_THROW(GoalEstimator{parameters}, std::invalid_argument) << number << ": " << bad;
      EXPECT_THROW(OrientationEstimator{parameters}, std::invalid_argument) << number;
    }
  }
}

TEST(MotionEnd, EachThresholdCountsAndEachHasToBePositive) {
  using P = MotionEndParameters;
  const Vector3 goal(0.5, 0, 0);
  const auto ends = [&goal](double phase, double speed, double turning, double away, double raw) {
    MotionEnd end;
    return end.update(kCycle, phase, speed, turning, goal + Vector3(0, away, 0), goal,
                      goal + Vector3(0, 0, raw)) == MotionEnd::Event::Ended;
  };
  EXPECT_TRUE(ends(0.0119, 0.0199, 0.199, 0.00499, 0.0299));
  EXPECT_FALSE(ends(0.0121, 0.0, 0.0, 0.0, 0.0));
  EXPECT_FALSE(ends(0.0, 0.0201, 0.0, 0.0, 0.0));
  EXPECT_FALSE(ends(0.0, 0.0, 0.201, 0.0, 0.0));
  EXPECT_FALSE(ends(0.0, 0.0, 0.0, 0.00501, 0.0));
  EXPECT_FALSE(ends(0.0, 0.0, 0.0, 0.0, 0.0301));
  for (double P::*field :
       {&P::phase, &P::speed, &P::turning, &P::distance, &P::follow_distance, &P::follow_time}) {
    for (const double bad : {0.0, -1.0, kNan, static_cast<double>(INFINITY)}) {
      P parameters;
      parameters.*field = bad;
      EXPECT_THROW(MotionEnd{parameters}, std::invalid_argument) << bad;
    }
  }
  MotionEnd end;
  EXPECT_FALSE(end.latched());
  end.update(kCycle, 0.0, 0.0, 0.0, goal, goal, goal);
  EXPECT_TRUE(end.latched());
  EXPECT_EQ(end.latchedGoal(), goal);
  end.reset();
  EXPECT_FALSE(end.latched());
}

TEST(CartesianMotion, AGoalIsDrawnBackUntilTheMiddleAndThenLessAsAMinimumJerkMotionGoes) {
  const CartesianMotionPlan plan = reachPlan();
  const Vector3 goal(0.5, 0.1, 0), approach(0.0, 0.0, -0.1);
  CartesianMotion motion;
  Dmp dmp;
  motion.start(plan, {}, Vector3::Zero(), Vector3::Zero(), {goal, Quaternion::Identity()},
               approach);
  dmp.start(plan.system, Vector3::Zero(), Vector3::Zero(), goal - approach, 1.0);
  double last = 1.0;
  for (int i = 0; i < 240; ++i) {
    const double drawn = 1.0 - minimumJerk((dmp.progress() - 0.5) / 0.5);
    motion.step(kCycle, {goal, Quaternion::Identity()}, 1.0, approach);
    if (motion.phase() != CartesianMotion::Phase::Running) break;
    dmp.step(kCycle, goal - drawn * approach, (last - drawn) / kCycle * approach);
    last = drawn;
    ASSERT_LT((motion.goal() - (goal - drawn * approach)).norm(), 1e-12) << i;
    ASSERT_LT((motion.dmp().state().position - dmp.state().position).norm(), 1e-9) << i;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(CartesianMotion, ASlowArrivalBrakesGentlyAndIsSlowOnTheLastWay) {
  EXPECT_EQ(kSlowWay, 0.02);
  EXPECT_EQ(kGentleBraking, 0.6);
  EXPECT_EQ(kFastestArrival, 0.45);
  CartesianMotionPlan plan = reachPlan(0.8);
  plan.arrival_speed = 0.05;
  const Vector3 goal(0.5, 0, 0);
  CartesianMotion motion;
  motion.start(plan, {}, Vector3::Zero(), Vector3::Zero(), {goal, Quaternion::Identity()});
  int bound = 0;
  for (int i = 0; i < 1000 && motion.phase() == CartesianMotion::Phase::Running; ++i) {
    const double way = std::max(0.0, (goal - motion.dmp().state().position).norm() - 0.02);
    const double most = std::min(0.45, std::sqrt(0.05 * 0.05 + 2.0 * 0.6 * way));
    const double speed = motion.dmp().state().velocity.norm();
    motion.step(kCycle, {goal, Quaternion::Identity()});
    if (speed <= most) continue;
    ++bound;  // the share of the clock is what brings the speed down to that
    ASSERT_NEAR(motion.velocity().norm(), most / speed * motion.dmp().state().velocity.norm(),
                1e-9);
  }
  EXPECT_GT(bound, 100);
}

TEST(CartesianMotion, ATremblingTurnIsNoiseFromAThirdOfARadianPerSecondOn) {
  CartesianMotion motion;
  OrientationEstimator expected;
  GoalJitter jitter(0.3);
  Random random(9);
  const Vector3 goal(0.5, 0, 0);
  Quaternion seen = Quaternion::Identity();
  motion.start(reachPlan(2.0), {}, Vector3::Zero(), Vector3::Zero(), {goal, seen});
  expected.reset(seen);
  double largest = 0.0;
  for (int i = 0; i < 150; ++i) {
    const Quaternion before = seen;
    if (i % 7 == 3) seen = expRotation(random.point(0.01));
    if (i % 7 == 3) {
      jitter.see(kCycle, rotationBetween(before, seen));
    } else {
      jitter.wait(kCycle);
    }
    motion.step(kCycle, {goal, seen});
    expected.update(kCycle, seen, jitter.share());
    largest = std::max(largest, jitter.share());
    ASSERT_LT(motion.goalOrientation().angularDistance(expected.orientation()), 1e-7) << i;
  }
  EXPECT_GT(largest, 0.2);
  EXPECT_LT(largest, 1.0);
}

TEST(RollOut, CoversThreeDurationsAndTwoSecondsOfAMotionThatNeverArrives) {
  MotionEndParameters never;
  never.phase = 1e-200;
  const Pose goal{Vector3(0.5, 0, 0), Quaternion::Identity()};
  for (const double duration : {0.5, 1.0, 8.0}) {
    CartesianMotion motion({}, never);
    motion.start(reachPlan(duration), {}, Vector3::Zero(), Vector3::Zero(), goal);
    const double step = std::max(0.01, duration / 400.0), longest = 3.0 * duration + 2.0;
    for (const double rate : {2.0, 0.5, 0.0}) {
      const double clock = std::min(1.0, std::max(0.1, rate));
      const TimedPath path = rollOut(motion, goal, rate);
      ASSERT_EQ(path.times.size(), 41u);
      EXPECT_NEAR(path.times.back() * clock, longest - step, 1.01 * step) << duration << rate;
      EXPECT_LT(path.times.back() * clock, longest);
      EXPECT_EQ(path.times.front(), 0.0);
    }
  }
  CartesianMotion quick;  // few steps are all kept
  quick.start(reachPlan(0.2), {}, Vector3::Zero(), Vector3::Zero(), goal);
  const TimedPath path = rollOut(quick, goal);
  for (std::size_t i = 0; i < path.times.size() && path.times.size() <= 41; ++i) {
    EXPECT_NEAR(path.times[i], 0.01 * static_cast<double>(i), 1e-9);
  }
  EXPECT_LT((path.poses.back().position - goal.position).norm(), 2e-3);
}
