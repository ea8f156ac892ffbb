// Goal estimator and orientation curve: what a goal and an orientation become before eq. (1), and
// how a motion uses them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/dmp/orientation_curve.hpp"
#include "coglab_controllers/goal/goal_estimator.hpp"
#include "coglab_controllers/kinematics/rotation.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

constexpr double kCycle = 0.005;
const Vector3 kStill = Vector3::Zero();

CartesianMotionPlan reachPlan(double duration = 1.0) {
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const Trajectory reach = minimumJerkReach(kStill, Vector3(0.51, 0, 0), duration);
  return {TransformationSystem(learn("reach", {reach}, options)), 1.0, true};
}

}  // namespace

TEST(GoalEstimator, MeetsASteadyRampWithoutLag) {
  GoalEstimator estimator;
  Vector3 goal = Vector3::Zero();
  const Vector3 speed(0.07, -0.12, 0.04);
  estimator.reset(goal);
  for (int i = 0; i < 400; ++i) {
    goal += kCycle * speed;
    estimator.update(kCycle, goal);
  }
  // The input is held over the cycle, so what can be met is its value within that cycle.
  EXPECT_LT((estimator.position() - goal).norm(), kCycle * speed.norm());
  EXPECT_LT((estimator.velocity() - speed).norm(), 1e-6);
}

/// How far the estimate is beyond a goal that goes along x with `speed` for `time` s and then
/// rests.
double ledBeyond(double speed, double time, bool predicted) {
  GoalEstimator estimator;
  estimator.reset(Vector3::Zero());
  double farthest = 0.0;
  for (int i = 1; i <= 400; ++i) {
    const double x = speed * std::min(i * kCycle, time);
    estimator.update(kCycle, Vector3(x, 0, 0), 0.0, predicted);
    farthest = std::max(farthest, estimator.position().x());
  }
  EXPECT_NEAR(estimator.position().x(), speed * time, 1e-4);
  return farthest - speed * time;
}

TEST(GoalEstimator, AHandThatComesFastIsNotLed) {
  const double slow = ledBeyond(0.15, 0.4, false);
  EXPECT_GT(slow, 0.005);  // the price of no lag behind a goal that goes on
  // It would be five times as far beyond a hand that is five times as fast, and stops.
  EXPECT_LT(ledBeyond(0.75, 0.4, false), 2.5 * slow);
  GoalEstimator estimator;
  estimator.reset(Vector3::Zero());
  for (int i = 1; i <= 400; ++i) {
    estimator.update(kCycle, Vector3(0, 0, -0.003 * i));
    EXPECT_LE(estimator.velocity().norm(), GoalEstimatorParameters().max_speed + 1e-12);
  }
}

TEST(GoalEstimator, AChangeOfAPredictionIsNotLed) {
  EXPECT_GT(ledBeyond(0.05, 0.4, false), 0.002);
  EXPECT_LT(ledBeyond(0.05, 0.4, true), 0.0005);
  // What is predicted may move, too.
  GoalEstimator estimator;
  estimator.reset(Vector3::Zero());
  for (int i = 1; i <= 400; ++i)
    estimator.update(kCycle, Vector3(0.13 * kCycle * i, 0, 0), 0, true);
  EXPECT_NEAR(estimator.velocity().x(), 0.13, 0.005);
}

TEST(GoalEstimator, RefusesSpeedsThatAreNone) {
  for (const double bad : {-0.1, std::nan(""), 1.0 / 0.0}) {
    GoalEstimatorParameters parameters;
    parameters.predicted_speed = bad;
    EXPECT_THROW(GoalEstimator{parameters}, std::invalid_argument);
    parameters = {};
    parameters.max_speed = bad;
    EXPECT_THROW(GoalEstimator{parameters}, std::invalid_argument);
  }
}

TEST(GoalEstimator, HasNoStepWhenTheGoalHasOne) {
  GoalEstimator estimator;
  estimator.reset(Vector3::Zero());
  Vector3 last_position = Vector3::Zero(), last_velocity = Vector3::Zero();
  for (int i = 0; i < 200; ++i) {
    estimator.update(0.001, Vector3(0.1, 0, 0));
    EXPECT_LT((estimator.position() - last_position).norm(), 0.1 * 0.001 / 0.06);
    EXPECT_LT((estimator.velocity() - last_velocity).norm(), 0.25 * 0.1 * 0.001 / (0.06 * 0.06));
    last_position = estimator.position();
    last_velocity = estimator.velocity();
  }
}

TEST(GoalEstimator, IsExactForAnyCycleTime) {
  Random random(1);
  for (int k = 0; k < 2000; ++k) {
    GoalEstimator one, many;
    const Vector3 start = random.point(0.02), goal = random.point(0.02);
    one.reset(start);
    many.reset(start);
    const double dt = random.uniform(0.001, 0.2);
    one.update(dt, goal);
    for (int i = 0; i < 20; ++i) many.update(dt / 20, goal);
    EXPECT_LT((one.position() - many.position()).norm(), 1e-12);
    EXPECT_LT((one.velocity() - many.velocity()).norm(), 1e-11);
  }
}

TEST(GoalEstimator, AFarGoalPullsNoHarder) {
  GoalEstimator estimator;
  estimator.reset(Vector3::Zero());
  double fastest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    estimator.update(kCycle, Vector3(2.0, 0, 0));
    fastest = std::max(fastest, estimator.velocity().norm());
  }
  EXPECT_LT(fastest, 0.15 / (2.0 * 0.06));
  EXPECT_LT((estimator.position() - Vector3(2.0, 0, 0)).norm(), 1e-6);
}

TEST(GoalEstimator, OffIsThePlainInput) {
  GoalEstimatorParameters parameters;
  parameters.time_constant = 0.0;
  GoalEstimator estimator(parameters);
  estimator.reset(Vector3::Zero());
  estimator.update(kCycle, Vector3(1, 2, 3));
  EXPECT_EQ(estimator.position(), Vector3(1, 2, 3));
  EXPECT_TRUE(estimator.velocity().isZero(0.0));
  parameters.time_constant = -1.0;
  EXPECT_THROW(GoalEstimator{parameters}, std::invalid_argument);
}

TEST(OrientationEstimator, FollowsATurningObject) {
  OrientationEstimator estimator;
  const Vector3 rate(0.3, 0.2, -0.4);
  Quaternion target = Quaternion::Identity();
  estimator.reset(target);
  for (int i = 0; i < 1000; ++i) {
    target = expRotation(kCycle * rate) * target;
    // Both signs of a quaternion mean the same orientation.
    if (i % 2) target.coeffs() *= -1.0;
    estimator.update(kCycle, target);
  }
  EXPECT_LT(estimator.orientation().angularDistance(target), 0.02);
  EXPECT_LT((estimator.angularVelocity() - rate).norm(), 0.02);
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

TEST(OrientationCurve, ATargetThatPassesHalfATurnMakesNoJump) {
  OrientationCurve curve;
  curve.start(Quaternion::Identity(), Vector3::Zero(), expRotation(Vector3(0, 0, 3.0)), 1.0);
  Quaternion last = curve.at(0.6);
  for (double angle = 3.0; angle < 4.0; angle += 0.01) {
    curve.setTarget(expRotation(Vector3(0, 0, angle)));
    EXPECT_LT(curve.at(0.6).angularDistance(last), 0.011);
    last = curve.at(0.6);
  }
}

TEST(OrientationCurve, ATargetMayTurnOnTowardAWholeTurn) {
  OrientationCurve curve;
  curve.start(Quaternion::Identity(), Vector3::Zero(), expRotation(Vector3(0, 0, 3.0)), 1.0);
  for (double angle = 3.0; angle < 6.2; angle += 0.01) {
    curve.setTarget(expRotation(Vector3(0, 0, angle)));
    // Half of the way is half of the whole angle, not of what is left to a whole turn.
    EXPECT_LT(curve.at(0.5).angularDistance(expRotation(Vector3(0, 0, 0.5 * angle))), 1e-6)
        << angle;
  }
}

TEST(GoalEstimator, ItsTimeConstantFollowsTheNoiseWithinAThirdOfASecond) {
  for (const double constant : {0.06, 0.2}) {  // one that is slow already stays as it is
    GoalEstimatorParameters parameters;
    parameters.time_constant = constant;
    parameters.noisy_speed = 0.0;
    GoalEstimator estimator(parameters);
    estimator.reset(kStill);
    ThirdOrderTracker tracker;
    double present = constant;
    Vector3 smooth = kStill;
    for (int i = 0; i < 300; ++i) {
      const double noise = i < 60 ? 1.0 : i < 120 ? 0.25 : i < 180 ? -3.0 : 7.0;
      const Vector3 goal = (i / 50 % 2 == 0 ? 1.0 : -1.0) * Vector3(0.004, -0.002, 0.001);
      const double wanted = constant + std::clamp(noise, 0.0, 1.0) * std::max(0.0, 0.10 - constant);
      present = wanted + (present - wanted) * std::exp(-kCycle / 0.3);
      const Vector3 way = tracker.advance(goal - smooth, kCycle, present);
      smooth += way;
      estimator.update(kCycle, goal, noise);
      ASSERT_LT((estimator.velocity() - tracker.rate).norm(), 1e-12) << i;
      ASSERT_LT((estimator.position() - smooth - 3.0 * present * tracker.rate).norm(), 1e-12) << i;
    }
    const Vector3 position = estimator.position(), velocity = estimator.velocity();
    ASSERT_GT(velocity.norm(), 1e-4);
    for (const double no_time : {0.0, -0.1}) {
      estimator.update(no_time, Vector3(5.0, 5.0, 5.0), 1.0, true);
      EXPECT_EQ(estimator.position(), position) << no_time;
      EXPECT_EQ(estimator.velocity(), velocity) << no_time;
    }
  }
}

TEST(GoalEstimator, AfterAResetBothAreAsNew) {
  GoalEstimator used, fresh;
  OrientationEstimator turned, new_one;
  for (int i = 0; i < 40; ++i) {
    used.update(kCycle, Vector3(0.1, 0.002 * i, 0.0), 1.0);
    turned.update(kCycle, expRotation(Vector3(0.0, 0.01 * i, 0.3)), 1.0);
  }
  const Quaternion still = turned.orientation();
  const Vector3 turning = turned.angularVelocity();
  turned.update(0.0, expRotation(Vector3(1.0, 0.0, 0.0)), 0.0);
  EXPECT_EQ(turned.orientation().coeffs(), still.coeffs()) << "no time, no change";
  EXPECT_EQ(turned.angularVelocity(), turning);
  const Vector3 goal(0.3, -0.2, 0.1);
  const Quaternion target = expRotation(Vector3(0.4, 0.0, 0.2));
  for (GoalEstimator* one : {&used, &fresh}) one->reset(goal);
  for (OrientationEstimator* one : {&turned, &new_one}) one->reset(target);
  EXPECT_EQ(used.position(), goal);
  EXPECT_TRUE(used.velocity().isZero(0.0) && turned.angularVelocity().isZero(0.0));
  EXPECT_LT(turned.orientation().angularDistance(target), 1e-7);
  for (int i = 0; i < 40; ++i) {
    const Vector3 moved = goal + Vector3(0.0, 0.0, 0.0005 * i);
    for (GoalEstimator* one : {&used, &fresh}) one->update(kCycle, moved, 0.5);
    for (OrientationEstimator* one : {&turned, &new_one}) {
      one->update(kCycle, expRotation(Vector3(0.002 * i, 0.0, 0.0)) * target, 0.5);
    }
    ASSERT_EQ(used.position(), fresh.position()) << i;
    ASSERT_EQ(turned.orientation().coeffs(), new_one.orientation().coeffs()) << i;
  }
}

TEST(GoalJitter, IsFullNoiseAtMost) {
  GoalJitter jitter(0.1);
  for (int i = 0; i < 20; ++i) jitter.see(kCycle, Vector3(i % 2 == 0 ? 1.0 : -1.0, 0.0, 0.0));
  EXPECT_GT(jitter.speed(), 0.2);
  EXPECT_EQ(jitter.share(), 1.0);
}

TEST(CartesianMotion, ATremblingGoalIsNoiseFromThreeCentimetresPerSecondOn) {
  for (const bool predicted : {false, true}) {
    CartesianMotionPlan plan = reachPlan(2.0);
    plan.predicted = predicted;
    CartesianMotion motion;
    GoalEstimator expected;
    GoalJitter jitter(0.03);
    Random random(9);
    const Vector3 goal(0.5, 0.1, 0.0);
    Vector3 seen = goal;
    motion.start(plan, {}, kStill, kStill, {seen, Quaternion::Identity()});
    expected.reset(seen);
    double largest = 0.0;
    for (int i = 0; i < 200; ++i) {
      const Vector3 before = seen;
      if (i % 7 == 3) seen = goal + random.point(0.001) + Vector3(0.0, 0.0002 * i, 0.0);
      if (i % 7 == 3) {
        jitter.see(kCycle, seen - before);
      } else {
        jitter.wait(kCycle);
      }
      const Vector3 estimate = expected.position();
      motion.step(kCycle, {seen, Quaternion::Identity()});
      expected.update(kCycle, seen, jitter.share(), predicted);
      largest = std::max(largest, jitter.share());
      ASSERT_LT((motion.goal() - estimate).norm(), 1e-12) << i;
    }
    EXPECT_GT(largest, 0.1);
    EXPECT_LT(largest, 1.0);
  }
}

TEST(CartesianMotion, OneThatWasUsedBeginsAsANewOneDoes) {
  CartesianMotion used, fresh;
  CartesianMotionPlan plan = reachPlan(0.8);
  plan.arrival_speed = 0.05;
  plan.predicted = true;
  const Vector3 approach(0.0, 0.0, -0.1), velocity(0.1, -0.2, 0.05), turning(0.3, 0.2, -0.1);
  Random random(10);
  Pose goal{Vector3(0.5, 0.1, 0.0), Quaternion::Identity()};
  used.start(plan, {}, kStill, kStill, goal, approach);
  for (int i = 0; i < 2000 && used.event() != MotionEnd::Event::Ended; ++i) {
    if (i % 7 == 0 && i < 120) {
      goal.position += random.point(0.002);
      goal.orientation = expRotation(random.point(0.05));
    }
    if (i == 100) used.switchTo(plan, goal);
    used.step(kCycle, goal, 1.0, approach);
  }
  ASSERT_EQ(used.event(), MotionEnd::Event::Ended);
  plan = reachPlan();
  const Pose begin{Vector3(0.1, 0.2, 0.3), expRotation(Vector3(0.0, 0.4, 0.0))};
  const Dmp plain = [&] {
    Dmp dmp;
    dmp.start(plan.system, begin.position, velocity, goal.position - approach, 1.0);
    return dmp;
  }();
  for (CartesianMotion* motion : {&used, &fresh}) {
    motion->start(plan, begin, velocity, turning, goal, approach);
    EXPECT_EQ(motion->phase(), CartesianMotion::Phase::Running);
    EXPECT_EQ(motion->event(), MotionEnd::Event::None);
    EXPECT_EQ(motion->velocity(), velocity);
    EXPECT_EQ(motion->reference().pose.position, begin.position);
    EXPECT_EQ(motion->reference().velocity, velocity);
    EXPECT_EQ(motion->reference().angular_velocity, turning);
    EXPECT_TRUE(motion->reference().orientation_control);
    EXPECT_EQ(motion->goal(), goal.position);
    EXPECT_EQ(motion->dmp().system().movingPoint(0.5), plain.system().movingPoint(0.5));
  }
  for (int i = 0; i < 300; ++i) {
    if (i % 7 == 0) goal.position += random.point(0.001);
    if (i % 7 == 0) goal.orientation = expRotation(random.point(0.05));
    for (CartesianMotion* motion : {&used, &fresh}) motion->step(kCycle, goal, 0.8, approach);
    ASSERT_EQ(used.dmp().state().position, fresh.dmp().state().position) << i;
    ASSERT_EQ(used.reference().angular_velocity, fresh.reference().angular_velocity) << i;
    ASSERT_EQ(used.event(), fresh.event()) << i;
  }
}
