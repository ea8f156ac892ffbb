// The whole Cartesian motion: moving, noisy and leaving goals, its end, switches, slow arrivals.
#include <algorithm>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

DmpPlan reachPlan(double duration = 1.0, double length = 0.51) {
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const Primitive p =
      learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(length, 0, 0), duration)}, options);
  return {Dmp(p), 1.0, true};
}

Pose at(const Vector3& position, const Quaternion& orientation = Quaternion::Identity()) {
  return {position, orientation};
}

}  // namespace

/// Frames at 30 Hz, 7 cycles apart: `goal(time)` plus noise of 4 mm per axis that wanders with a
/// correlation time of 0.5 s, or is white with 0.
class Sights {
 public:
  Sights(int seed, double noise, double correlation)
      : random_(seed),
        noise_(noise),
        keep_(correlation > 0.0 ? std::exp(-7 * kCycle / correlation) : 0.0) {
    error_ = draw();
  }
  template <typename Goal>
  Vector3 at(int cycle, Goal&& goal) {
    if (cycle % 7 == 0) {
      error_ = keep_ * error_ + std::sqrt(1.0 - keep_ * keep_) * draw();
      seen_ = goal(cycle * kCycle) + error_;
    }
    return seen_;
  }

 private:
  Vector3 draw() {
    return Vector3(random_.normal(noise_), random_.normal(noise_), random_.normal(noise_));
  }
  Random random_;
  double noise_, keep_;
  Vector3 error_ = Vector3::Zero(), seen_ = Vector3::Zero();
};

TEST(CartesianMotion, ANoisyGoalTakesLittleLongerThanAStillOne) {
  const Vector3 goal(0.51, 0, 0);
  const auto still = [&goal](double) { return goal; };
  const auto end_of = [&](Sights sights) {
    CartesianMotion motion;
    motion.start(reachPlan(), at(Vector3::Zero()), Vector3::Zero(), Vector3::Zero(),
                 at(sights.at(0, still)));
    for (int i = 0; i < 1000; ++i) {
      motion.step(kCycle, at(sights.at(i, still)));
      if (motion.event() == CartesianMotion::Event::Ended) return i * kCycle;
    }
    return 1e9;
  };
  const double exact = end_of(Sights(1, 0.0, 0.0));
  for (const double correlation : {0.0, 0.5}) {
    std::vector<double> later;
    for (int seed = 1; seed <= 101; ++seed) {
      later.push_back(end_of(Sights(seed, 0.004, correlation)) - exact);
    }
    std::sort(later.begin(), later.end());
    EXPECT_LT(later[50], 0.1) << correlation;
    EXPECT_LT(later[95], 0.4) << correlation;
  }
}

TEST(CartesianMotion, AMovingNoisyGoalDoesNotCountAsReached) {
  // 0.15 m/s is faster than any noise lets pass: such a motion goes on as long as the goal does.
  for (int seed = 1; seed <= 20; ++seed) {
    Sights sights(seed, 0.002, 0.5);
    const auto goal = [](double t) { return Vector3(0.4, 0.15 * t, 0); };
    CartesianMotion motion;
    motion.start(reachPlan(), at(Vector3::Zero()), Vector3::Zero(), Vector3::Zero(), at(goal(0)));
    int ended = 0;
    for (int i = 0; i < 500; ++i) {
      motion.step(kCycle, at(sights.at(i, goal)));
      if (motion.event() == CartesianMotion::Event::Ended) ++ended;
    }
    EXPECT_EQ(ended, 0) << seed;
  }
}

TEST(CartesianMotion, WithTheEstimatorOffItIsThePlainDmp) {
  GoalFilterParameters off;
  off.time_constant = 0.0;
  CartesianMotion motion(off);
  const DmpPlan plan = reachPlan();
  Random random(3);
  for (int k = 0; k < 50; ++k) {
    const Vector3 start = random.point(0.3), goal = start + random.point(0.5);
    motion.start(plan, at(start), Vector3::Zero(), Vector3::Zero(), at(goal));
    Dmp dmp = plan.dmp;
    dmp.start(start, Vector3::Zero(), goal, 1.0);
    for (int i = 0; i < 150; ++i) {
      motion.step(kCycle, at(goal));
      dmp.step(kCycle, goal);
      ASSERT_LT((motion.dmp().state().position - dmp.state().position).norm(), 1e-12);
    }
  }
}

TEST(CartesianMotion, AGoalStepMakesNoAccelerationStep) {
  CartesianMotion motion;
  const Vector3 goal(0.51, 0, 0), moved(0.51, 0.1, 0);
  motion.start(reachPlan(), at(Vector3::Zero()), Vector3::Zero(), Vector3::Zero(), at(goal));
  Vector3 last = Vector3::Zero();
  double worst = 0.0, settled = 0.0;
  for (int i = 0; i < 400; ++i) {
    motion.step(kCycle, at(i * kCycle < 0.3 - 1e-9 ? goal : moved));
    if (i > 0) worst = std::max(worst, (motion.dmp().state().acceleration - last).norm());
    last = motion.dmp().state().acceleration;
    if ((motion.dmp().state().position - moved).norm() > 0.01) settled = (i + 2) * kCycle;
  }
  EXPECT_LT(worst, 1.0);
  EXPECT_LE(settled, 0.95);
}

TEST(CartesianMotion, AnApproachingGoalDoesNotPushTheHandBackward) {
  // Half of a person's reach toward the robot is over when the motion starts (docs/people.md).
  const auto share = [](double u) {
    u = std::min(1.0, u);
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
  };
  const auto goal = [&](double t) {
    const double left = 1.0 - share(0.6 + t / 1.1);
    return Vector3(0.42 + 0.43 * left, 0.1 * left, 0);
  };
  DmpPlan plan = reachPlan();
  for (const double ratio : {1.0, 1.2, 1.5}) {
    plan.ratio = ratio;
    CartesianMotion motion;
    motion.start(plan, at(Vector3::Zero()), Vector3::Zero(), Vector3::Zero(), at(goal(0)));
    double backward = 0.0, way = 0.0;
    Vector3 last = Vector3::Zero();
    for (int i = 0; i < 600; ++i) {
      motion.step(kCycle, at(goal(i * kCycle)));
      const Vector3 now = motion.dmp().state().position;
      backward = std::max(backward, -now.x());
      way += (now - last).norm();
      last = now;
    }
    EXPECT_LT(backward, 0.008) << ratio;
    EXPECT_LT(way / last.norm(), 1.09) << ratio;
  }
}

TEST(CartesianMotion, NoiseOfTheGoalHardlyMovesTheHandAndASlowGoalIsFollowedInIt) {
  for (const double correlation : {0.0, 0.5}) {
    for (const double speed : {0.0, 0.1}) {
      const auto goal = [&](double t) { return Vector3(0.51, speed * t, 0); };
      std::vector<double> added, behind;
      for (int seed = 1; seed <= 21; ++seed) {
        Sights sights(seed, 0.004, correlation);
        CartesianMotion exact, noisy;
        const Pose begin = at(Vector3::Zero());
        exact.start(reachPlan(), begin, Vector3::Zero(), Vector3::Zero(), at(goal(0)));
        noisy.start(reachPlan(), begin, Vector3::Zero(), Vector3::Zero(), at(sights.at(0, goal)));
        double power = 0.0, lag = 0.0;
        for (int i = 0; i < 300; ++i) {
          exact.step(kCycle, at(goal(i * kCycle)));
          noisy.step(kCycle, at(sights.at(i, goal)));
          const Vector3 extra = noisy.reference().velocity - exact.reference().velocity;
          if (i < 200) power += extra.squaredNorm() / 200;
          if (i >= 200) lag += (goal(i * kCycle) - noisy.dmp().state().position).y() / 100;
        }
        added.push_back(std::sqrt(power));
        behind.push_back(lag);
      }
      std::sort(added.begin(), added.end());
      std::sort(behind.begin(), behind.end());
      if (speed == 0.0) EXPECT_LT(added[10], 0.015) << correlation;
      // 2 mm are asked for; correlated noise is missed by as much again (docs/deviations.md).
      if (speed > 0.0) EXPECT_LT(std::abs(behind[10]), correlation > 0.0 ? 0.005 : 0.003);
    }
  }
}

TEST(CartesianMotion, FollowsAGoalThatLeavesAfterTheEnd) {
  CartesianMotion motion;
  const Vector3 goal(0.51, 0, 0), moved(0.51, 0.05, 0);
  motion.start(reachPlan(), at(Vector3::Zero()), Vector3::Zero(), Vector3::Zero(), at(goal));
  for (int i = 0; i < 600; ++i) motion.step(kCycle, at(goal));
  EXPECT_EQ(motion.phase(), CartesianMotion::Phase::Ended);
  bool again = false;
  Vector3 last = motion.dmp().state().velocity;
  for (int i = 0; i < 600; ++i) {
    motion.step(kCycle, at(moved));
    again = again || motion.event() == CartesianMotion::Event::FollowsAgain;
    ASSERT_LT((motion.dmp().state().velocity - last).norm(), 0.03) << i;
    last = motion.dmp().state().velocity;
  }
  EXPECT_TRUE(again);
  EXPECT_EQ(motion.phase(), CartesianMotion::Phase::Ended);
  EXPECT_LT((motion.dmp().state().position - moved).norm(), 0.002);
}

TEST(CartesianMotion, EndsInTheTargetOrientationAndFollowsATurningObject) {
  Random random(6);
  const DmpPlan plan = reachPlan();
  for (int k = 0; k < 100; ++k) {
    CartesianMotion motion;
    const Quaternion start = random.rotation();
    Pose goal = at(random.point(0.5), random.rotation());
    motion.start(plan, at(Vector3::Zero(), start), Vector3::Zero(), Vector3::Zero(), goal);
    const Vector3 turning = random.point(0.5);
    double bend = 0.0;
    Vector3 last = Vector3::Zero();
    Quaternion pose = start;
    for (int i = 0; i < 600; ++i) {
      if (i < 150) goal.orientation = expRotation(kCycle * turning) * goal.orientation;
      const CartesianReference& reference = motion.step(kCycle, goal);
      ASSERT_LT(pose.angularDistance(reference.pose.orientation), 1e-6);
      pose = expRotation(kCycle * reference.angular_velocity) * pose;
      bend = std::max(bend, (reference.angular_velocity - last).norm());
      last = reference.angular_velocity;
    }
    EXPECT_LT(pose.angularDistance(goal.orientation), 0.02);
    EXPECT_LT(bend, 0.4);
  }
}

TEST(CartesianMotion, ItsVelocitiesLeadToItsPoses) {
  Random random(7);
  CartesianMotion motion;
  const DmpPlan plan = reachPlan();
  Pose goal = at(Vector3(0.4, 0.2, 0.1), random.rotation());
  motion.start(plan, at(Vector3::Zero()), Vector3(0.1, 0, 0), Vector3(0, 0.2, 0), goal);
  Vector3 position = Vector3::Zero();
  for (int i = 0; i < 800; ++i) {
    if (i % 50 == 0) goal.position += random.point(0.03);
    if (i == 120) motion.switchTo(plan, goal);
    const CartesianReference& reference = motion.step(kCycle, goal, i < 200 ? 1.0 : 0.4);
    ASSERT_LT((reference.pose.position - position).norm(), 1e-9);
    position += kCycle * reference.velocity;
  }
}

TEST(CartesianMotion, ApproachShiftsTheGoalFullyUntilTheMiddle) {
  const DmpPlan plan = reachPlan();
  const Vector3 goal(0.5, 0.1, 0), approach(0.0, 0.0, -0.1);
  CartesianMotion motion;
  Dmp dmp = plan.dmp;
  motion.start(plan, {}, Vector3::Zero(), Vector3::Zero(), {goal, Quaternion::Identity()},
               approach);
  dmp.start(Vector3::Zero(), Vector3::Zero(), goal - approach, 1.0);
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

struct SlowArrival {
  double fastest = 0.0, near = 0.0, time = 0.0, detour = 0.0;  // m/s, m/s within 20 mm, s, m
};

/// A reach of 0.3 m in 0.9 s toward a goal that rests, or moves to the side from the middle on.
SlowArrival arrive(double arrival_speed, double aside = 0.0) {
  const Vector3 first(0.3, 0, 0);
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const auto demonstration = minimumJerkReach(Vector3::Zero(), first, 1.0);
  const DmpPlan plan{Dmp(learn("reach", {demonstration}, options)), 0.9, true, arrival_speed};
  CartesianMotion motion;
  motion.start(plan, {Vector3::Zero(), Quaternion::Identity()}, Vector3::Zero(), Vector3::Zero(),
               {first, Quaternion::Identity()});
  SlowArrival found;
  for (int i = 0; i < 2000 && motion.phase() == CartesianMotion::Phase::Running; ++i) {
    const double t = i * kCycle;
    const Vector3 goal = first + std::clamp(t - 0.5, 0.0, 0.5) * Vector3(0, aside, 0);
    const CartesianReference& now = motion.step(kCycle, {goal, Quaternion::Identity()});
    found.fastest = std::max(found.fastest, now.velocity.norm());
    if ((now.pose.position - goal).norm() < kSlowWay) {
      found.near = std::max(found.near, now.velocity.norm());
    }
    found.detour = std::max(found.detour, std::abs(now.pose.position.y()));
    found.time = t;
  }
  EXPECT_EQ(motion.phase(), CartesianMotion::Phase::Ended);
  return found;
}

TEST(CartesianMotion, ArrivesAtTheRequestedSpeed) {
  const SlowArrival slow = arrive(0.05), plain = arrive(0.0);
  EXPECT_GT(plain.near, 0.10);  // else there is nothing to slow down
  EXPECT_LT(slow.near, 0.055);
  EXPECT_GT(plain.fastest, 1.2 * kFastestArrival);
  EXPECT_LT(slow.fastest, 1.02 * kFastestArrival);
  EXPECT_LT(slow.time, plain.time + 1.0);
  EXPECT_LT(slow.detour, 1e-6);
}
