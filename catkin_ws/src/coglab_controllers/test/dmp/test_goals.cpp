// Processing of a goal before eq. (1): accepted frames, bounds, filter, and the orientation curve.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "coglab_controllers/dmp/orientation_curve.hpp"
#include "coglab_controllers/goal/goal_filter.hpp"
#include "coglab_controllers/goal/goal_limits.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kSecond = 1'000'000'000, kMs = 1'000'000;
using State = GoalLimits::State;

Pose pose(const Vector3& position) { return {position, Quaternion::Identity()}; }

GoalObservation at(const Vector3& position, std::int64_t frame_ns = 0) {
  GoalObservation seen;
  seen.position = position;
  seen.frame_ns = seen.stamp_ns = frame_ns;
  return seen;
}

GoalObservation sight(double x, std::int64_t frame_ns) {
  return at(Vector3(x, 0.0, 0.0), frame_ns);
}

GoalLimits begun(double x = 1.0, const GoalFrameLimits& frames = {}) {
  GoalLimits gate(frames);
  gate.begin(sight(x, kSecond));
  return gate;
}

/// One cycle at a time at which both clocks read the same.
State step(GoalLimits& gate, std::int64_t now_ns, const GoalObservation& newest) {
  return gate.update(now_ns, newest, now_ns);
}

TEST(GoalLimits, AFrameIsFollowedUpToItsJumpAndItsAge) {
  GoalLimits gate = begun();
  EXPECT_EQ(gate.state(), State::Fresh);
  EXPECT_EQ(gate.age(), 0.0);
  EXPECT_EQ(gate.jump(), 0.0);
  EXPECT_EQ(step(gate, kSecond + 10 * kMs, sight(1.1499, kSecond + 5 * kMs)), State::Fresh);
  EXPECT_NEAR(gate.jump(), 0.1499, 1e-12);
  EXPECT_NEAR(gate.age(), 0.005, 1e-12);
  EXPECT_EQ(gate.goal().position.x(), 1.1499);
  EXPECT_EQ(step(gate, kSecond + 10 * kMs, sight(1.3001, kSecond + 10 * kMs)), State::Jumped);
  EXPECT_NEAR(gate.jump(), 0.1502, 1e-12);
  EXPECT_EQ(gate.goal().position.x(), 1.1499);
  EXPECT_EQ(step(gate, kSecond + 20 * kMs, sight(1.1, kSecond + 20 * kMs)), State::Fresh);
  const GoalObservation last = sight(1.1, kSecond + 20 * kMs);
  EXPECT_EQ(step(gate, kSecond + 219 * kMs, last), State::Fresh);
  EXPECT_EQ(step(gate, kSecond + 221 * kMs, last), State::Old);
  EXPECT_EQ(step(gate, kSecond + 1019 * kMs, last), State::Old);
  EXPECT_EQ(step(gate, kSecond + 1021 * kMs, last), State::Lost);
  EXPECT_EQ(step(gate, kSecond + 1030 * kMs, sight(1.1, kSecond + 1030 * kMs)), State::Fresh);
}

TEST(GoalLimits, ThreeFramesThatAgreeWithinFiftyMillimetresAreAccepted) {
  for (const double apart : {0.049, 0.051}) {
    GoalLimits gate = begun(0.0);
    for (int i = 0; i < 3; ++i) {
      const std::int64_t t = kSecond + (i + 1) * kMs;
      const State expected = i == 2 && apart < 0.05 ? State::Fresh : State::Jumped;
      EXPECT_EQ(step(gate, t, sight(0.5 + apart * i, t)), expected) << apart << " " << i;
      EXPECT_EQ(step(gate, t, sight(0.5 + apart * i, t)), expected) << "a frame counts once";
    }
  }
  // A frame near the goal between them restarts the count.
  GoalLimits gate = begun(0.0);
  const double places[] = {0.5, 0.5, 0.0, 0.5, 0.5};
  for (int i = 0; i < 5; ++i) step(gate, kSecond + i, sight(places[i], kSecond + i + 1));
  EXPECT_EQ(gate.state(), State::Jumped);
  EXPECT_EQ(gate.goal().position.x(), 0.0);
}

TEST(GoalLimits, FramesThatJumpForASecondAreALostGoal) {
  GoalLimits gate = begun(0.0);
  for (int i = 1; i <= 100; ++i) {
    const std::int64_t t = kSecond + 10 * kMs * i;
    EXPECT_EQ(step(gate, t, sight(i % 2 == 0 ? 1.0 : -1.0, t)), State::Jumped) << i;
  }
  EXPECT_EQ(step(gate, kSecond + 1001 * kMs, sight(1.0, kSecond + 1001 * kMs)), State::Lost);
}

TEST(GoalLimits, WithoutALimitAGoalStaysValidOrIsNeverLost) {
  GoalFrameLimits forever;
  forever.max_age = 0.0;
  GoalLimits gate = begun(1.0, forever);
  EXPECT_EQ(step(gate, 1000 * kSecond, sight(1.0, kSecond)), State::Fresh);
  GoalFrameLimits never;
  never.lost_time = 0.0;
  gate = begun(1.0, never);
  EXPECT_EQ(step(gate, 1000 * kSecond, sight(1.0, kSecond)), State::Old);
}

TEST(GoalLimits, BeforeAMotionThreeAgreeingFramesAreNeededAnywhere) {
  GoalLimits gate;
  EXPECT_EQ(gate.state(), State::Unsettled);
  for (int i = 1; i <= 3; ++i) {
    EXPECT_EQ(step(gate, i * kMs, sight(0.0, i * kMs)), i < 3 ? State::Unsettled : State::Fresh);
  }
  GoalLimits still;  // a static frame, here at the origin, is accepted at once
  GoalObservation turned = sight(0.0, 0);
  turned.stamp_ns = kSecond;
  EXPECT_EQ(step(still, kSecond, turned), State::Fresh);
  turned.orientation = expRotation(Vector3(0.0, 0.0, 0.4));
  EXPECT_EQ(step(still, kSecond, turned), State::Fresh);
  EXPECT_LT(still.goal().orientation.angularDistance(turned.orientation), 1e-9);
  turned.stamp_ns = 5 * kSecond;  // and is as young as it was last seen
  EXPECT_EQ(step(still, 5 * kSecond + 100 * kMs, turned), State::Fresh);
  EXPECT_NEAR(still.age(), 0.1, 1e-9);
}

/// Overshoot of the estimate for a goal that moves along x with `speed` for `time` s, then rests.
double ledBeyond(double speed, double time, bool predicted) {
  GoalFilter filter;
  filter.begin(pose(Vector3::Zero()));
  double farthest = 0.0;
  for (int i = 1; i <= 400; ++i) {
    const double x = speed * std::min(i * kCycle, time);
    filter.update(kCycle, pose(Vector3(x, 0, 0)), predicted);
    farthest = std::max(farthest, filter.position().x());
  }
  EXPECT_NEAR(filter.position().x(), speed * time, 1e-4);
  return farthest - speed * time;
}

TEST(GoalFilter, MeetsASteadyRampWithoutLag) {
  GoalFilter filter;
  Vector3 goal = Vector3::Zero();
  const Vector3 speed(0.07, -0.12, 0.04);
  filter.begin(pose(goal));
  for (int i = 0; i < 400; ++i) {
    goal += kCycle * speed;
    filter.update(kCycle, pose(goal));
  }
  // The input is held over the cycle, so what can be met is its value within that cycle.
  EXPECT_LT((filter.position() - goal).norm(), kCycle * speed.norm());
  EXPECT_LT((filter.velocity() - speed).norm(), 1e-6);
}

TEST(GoalFilter, AFastHandGivesLittleGoalVelocity) {
  const double slow = ledBeyond(0.15, 0.4, false);
  EXPECT_GT(slow, 0.005);  // the price of no lag behind a goal that goes on
  // Without the bound, five times the speed would give five times the overshoot.
  EXPECT_LT(ledBeyond(0.75, 0.4, false), 2.5 * slow);
  GoalFilter filter;
  filter.begin(pose(Vector3::Zero()));
  for (int i = 1; i <= 400; ++i) {
    filter.update(kCycle, pose(Vector3(0, 0, -0.003 * i)));
    EXPECT_LE(filter.velocity().norm(), GoalFilterParameters().max_speed + 1e-12);
  }
}

TEST(GoalFilter, AChangeOfAPredictionGivesNoGoalVelocity) {
  EXPECT_GT(ledBeyond(0.05, 0.4, false), 0.002);
  EXPECT_LT(ledBeyond(0.05, 0.4, true), 0.0005);
  // A predicted goal may also move.
  GoalFilter filter;
  filter.begin(pose(Vector3::Zero()));
  for (int i = 1; i <= 400; ++i)
    filter.update(kCycle, pose(Vector3(0.13 * kCycle * i, 0, 0)), true);
  EXPECT_NEAR(filter.velocity().x(), 0.13, 0.005);
}

TEST(GoalFilter, IsExactForAnyCycleTime) {
  Random random(1);
  for (int k = 0; k < 2000; ++k) {
    GoalFilter one, many;
    const Vector3 start = random.point(0.02), goal = random.point(0.02);
    one.begin(pose(start));
    many.begin(pose(start));
    const double dt = random.uniform(0.001, 0.2);
    one.update(dt, pose(goal));
    for (int i = 0; i < 20; ++i) many.update(dt / 20, pose(goal));
    EXPECT_LT((one.position() - many.position()).norm(), 1e-12);
    EXPECT_LT((one.velocity() - many.velocity()).norm(), 1e-11);
  }
}

TEST(GoalFilter, SpeedIsBoundedForAFarGoal) {
  GoalFilter filter;
  filter.begin(pose(Vector3::Zero()));
  double fastest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    filter.update(kCycle, pose(Vector3(2.0, 0, 0)));
    fastest = std::max(fastest, filter.velocity().norm());
  }
  EXPECT_LT(fastest, 0.15 / (2.0 * 0.06));
  EXPECT_LT((filter.position() - Vector3(2.0, 0, 0)).norm(), 1e-6);
}

TEST(GoalFilter, OffIsThePlainInput) {
  GoalFilterParameters parameters;
  parameters.time_constant = 0.0;
  GoalFilter filter(parameters);
  filter.begin(pose(Vector3::Zero()));
  filter.update(kCycle, pose(Vector3(1, 2, 3)));
  EXPECT_EQ(filter.position(), Vector3(1, 2, 3));
  EXPECT_TRUE(filter.velocity().isZero(0.0));
  parameters.time_constant = -1.0;
  EXPECT_THROW(GoalFilter{parameters}, std::invalid_argument);
}

/// Frames at 30 Hz, 7 cycles apart: `goal(time)` plus noise (m per axis) that wanders with a
/// correlation time (s), or is white with 0. @return least and largest noise from cycle `from` on
template <typename Goal>
std::pair<double, double> noiseOf(double noise, double correlation, Goal goal, int from,
                                  int cycles) {
  Random random(3);
  const auto draw = [&] {
    return Vector3(random.normal(noise), random.normal(noise), random.normal(noise));
  };
  const double keep = correlation > 0.0 ? std::exp(-7 * kCycle / correlation) : 0.0;
  Vector3 error = draw();
  GoalFilter filter;
  filter.begin(pose(goal(0.0) + error));
  Pose seen;
  double least = 1.0, largest = 0.0;
  for (int i = 0; i < cycles; ++i) {
    if (i % 7 == 0) {
      error = keep * error + std::sqrt(1.0 - keep * keep) * draw();
      seen = pose(goal(i * kCycle) + error);
    }
    filter.measureNoise(kCycle, seen);
    if (i < from) continue;
    least = std::min(least, filter.noise());
    largest = std::max(largest, filter.noise());
  }
  return {least, largest};
}

TEST(GoalFilter, DistinguishesNoiseFromTheMotionOfAPerson) {
  const auto reach = [](double t) { return Vector3(0.5 * minimumJerk(t), 0, 0); };
  const auto still = [](double) { return Vector3(0.5, 0, 0); };
  const auto steady = [](double t) { return Vector3(0.5, 0.1 * t, 0); };
  const auto jump = [](double t) { return Vector3(0.5, t < 1.0 ? 0.0 : 0.1, 0); };
  EXPECT_LT(noiseOf(0.0, 0.0, reach, 0, 400).second, 0.5);
  EXPECT_LT(noiseOf(0.0, 0.0, reach, 220, 400).second, 0.2);  // soon after it rests
  EXPECT_LT(noiseOf(0.0, 0.0, steady, 30, 400).second, 0.05);
  EXPECT_LT(noiseOf(0.0, 0.0, jump, 400, 420).second, 0.1);
  EXPECT_LT(noiseOf(0.0001, 0.0, still, 100, 400).second, 0.2);  // a motion capture's
  EXPECT_GT(noiseOf(0.004, 0.0, still, 100, 400).first, 0.9);
  EXPECT_GT(noiseOf(0.004, 0.5, still, 100, 400).first, 0.5);
  EXPECT_GT(noiseOf(0.004, 0.5, steady, 100, 400).first, 0.5);
}

TEST(GoalFilter, FollowsATurningObject) {
  GoalFilter filter;
  const Vector3 rate(0.3, 0.2, -0.4);
  Quaternion target = Quaternion::Identity();
  filter.begin({Vector3::Zero(), target});
  for (int i = 0; i < 1000; ++i) {
    target = expRotation(kCycle * rate) * target;
    // Both signs of a quaternion mean the same orientation.
    if (i % 2) target.coeffs() *= -1.0;
    filter.update(kCycle, {Vector3::Zero(), target});
  }
  EXPECT_LT(filter.orientation().angularDistance(target), 0.02);
  EXPECT_LT((filter.angularVelocity() - rate).norm(), 0.02);
}

TEST(OrientationCurve, StartsAndEndsAsGiven) {
  Random random(2);
  for (int k = 0; k < 20000; ++k) {
    const Quaternion start = random.rotation(), target = random.rotation();
    const Vector3 velocity = random.point(1.0);
    const double duration = random.uniform(0.3, 3.0);
    OrientationCurve curve;
    curve.start(start, velocity, target, duration);
    ASSERT_LT(curve.at(0.0).angularDistance(start), 1e-7);
    ASSERT_LT(curve.at(1.0).angularDistance(target), 1e-7);
    const double h = 1e-6;
    ASSERT_LT((rotationBetween(curve.at(0.0), curve.at(h)) / (h * duration) - velocity).norm(),
              1e-3);
    ASSERT_LT(rotationBetween(curve.at(1.0 - h), curve.at(1.0)).norm() / h, 1e-3);
  }
}

TEST(OrientationCurve, ATurnFromRestFollowsTheMinimumJerkProfile) {
  OrientationCurve curve;
  const Vector3 turn(0.3, 1.0, -0.5);
  curve.start(Quaternion::Identity(), Vector3::Zero(), expRotation(turn), 1.0);
  for (double u = 0.0; u <= 1.0; u += 0.01) {
    EXPECT_LT(curve.at(u).angularDistance(expRotation(minimumJerk(u) * turn)), 1e-7);
  }
}

TEST(OrientationCurve, ATargetMayKeepTurningTowardAWholeTurn) {
  OrientationCurve curve;
  curve.start(Quaternion::Identity(), Vector3::Zero(), expRotation(Vector3(0, 0, 3.0)), 1.0);
  for (double angle = 3.0; angle < 6.2; angle += 0.01) {
    curve.setTarget(expRotation(Vector3(0, 0, angle)));
    // Half of the way is half of the whole angle, not of what is left to a whole turn.
    EXPECT_LT(curve.at(0.5).angularDistance(expRotation(Vector3(0, 0, 0.5 * angle))), 1e-6)
        << angle;
  }
}

}  // namespace
