// Reaches that arrive slowly: the clock is slowed toward the goal, the path stays.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

constexpr double kCycle = 0.005;

struct Arrival {
  double fastest = 0.0, near = 0.0, time = 0.0, detour = 0.0;  // m/s, m/s within 20 mm, s, m
};

/// A reach of 0.3 m in 0.9 s toward a goal that rests, or moves to the side from the middle on.
Arrival arrive(double arrival_speed, double aside = 0.0) {
  const Vector3 first(0.3, 0, 0);
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const auto demonstration = minimumJerkReach(Vector3::Zero(), first, 1.0);
  CartesianMotionPlan plan{TransformationSystem(learn("reach", {demonstration}, options)), 0.9,
                           true, arrival_speed};
  CartesianMotion motion;
  motion.start(plan, {Vector3::Zero(), Quaternion::Identity()}, Vector3::Zero(), Vector3::Zero(),
               {first, Quaternion::Identity()});
  Arrival found;
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

}  // namespace

TEST(CartesianMotion, ArrivesSlowlyWhereItIsAskedTo) {
  const Arrival slow = arrive(0.05), plain = arrive(0.0);
  EXPECT_GT(plain.near, 0.10);  // else there is nothing to slow down
  EXPECT_LT(slow.near, 0.055);
  EXPECT_GT(plain.fastest, 1.2 * kFastestArrival);
  EXPECT_LT(slow.fastest, 1.02 * kFastestArrival);
  EXPECT_LT(slow.time, plain.time + 1.0);
  EXPECT_LT(slow.detour, 1e-6);
}

TEST(CartesianMotion, ArrivesSlowlyAtAGoalThatMovesAside) {
  const Arrival slow = arrive(0.05, 0.1);
  EXPECT_LT(slow.near, 0.12);  // it has to follow, too
  EXPECT_LT(slow.fastest, 1.02 * kFastestArrival);
}
