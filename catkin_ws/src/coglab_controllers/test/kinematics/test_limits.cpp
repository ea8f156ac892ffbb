// Guard, workspace and phase governor: nothing leaves its limits, directions are kept.
#include <gtest/gtest.h>

#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/limits/phase_governor.hpp"
#include "coglab_rt/interpolator.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

GuardParameters armLimits() {
  GuardParameters p;
  p.upper_position << 2.967, 2.094, 2.967, 2.094, 2.967, 2.094, 2.967;
  p.lower_position = -p.upper_position;
  p.velocity << 1.92, 1.92, 1.96, 1.96, 2.27, 1.96, 1.96;
  return p;
}

// Wide enough never to bind.
WorkspaceParameters everywhere() {
  WorkspaceParameters w;
  w.box_min.setConstant(-10);
  w.box_max.setConstant(10);
  w.base_radius = 0.0;
  w.max_stretch = 1.0;
  return w;
}

}  // namespace

TEST(Guard, ScalesTheWholeVectorAndKeepsEveryLimit) {
  Random random(1);
  const GuardParameters p = armLimits();
  Guard guard(p, robot());
  int limited = 0;
  const int rounds = std::getenv("COGLAB_LONG") ? 3000000 : 200000;
  for (int k = 0; k < rounds; ++k) {
    const JointVector q = random.posture(-0.05),
                      request = random.joints(std::pow(10.0, random.uniform(-2, 1)));
    const ChainState state = robot().evaluate(q);
    GuardResult result;
    guard.limit(state, q, request, result);
    ASSERT_GE(result.scale, 0.0);
    ASSERT_LE(result.scale, 1.0);
    // The direction is kept, except for joints at their stop with a very small request.
    const double next_to_nothing =
        std::max(1e-3 * request.lpNorm<Eigen::Infinity>(), 1e-5) * result.scale;
    ASSERT_LE((result.velocity - result.scale * request).lpNorm<Eigen::Infinity>(),
              next_to_nothing + 1e-12);
    ASSERT_LE((result.velocity.array().abs() / p.velocity.array()).maxCoeff(), 1.0 + 1e-12);
    ASSERT_LE((state.jacobian.topRows<3>() * result.velocity).norm(), p.hand_speed + 1e-9);
    ASSERT_LE(Chain::originVelocity(state, robot().elbowJoint(), result.velocity).norm(),
              p.elbow_speed + 1e-9);
    for (int i = 0; i < kMaxJoints; ++i) {
      ASSERT_TRUE(q[i] < p.upper_position[i] || result.velocity[i] <= 0.0);
      ASSERT_TRUE(q[i] > p.lower_position[i] || result.velocity[i] >= 0.0);
    }
    ASSERT_EQ(result.reason == GuardReason::None, result.scale == 1.0);
    limited += result.scale < 1.0;
  }
  EXPECT_GT(limited, rounds / 10);
}

TEST(Guard, AJointNeverReachesItsStopAtFullSpeed) {
  // The arm follows with an interpolator of limited acceleration and jerk that starts one cycle
  // late.
  Random random(2);
  GuardParameters p = armLimits();
  p.workspace = everywhere();
  p.hand_speed = p.elbow_speed = 0.0;
  Guard guard(p, robot());
  coglab_rt::JointLimits limits;
  limits.lower_position = p.lower_position;
  limits.upper_position = p.upper_position;
  limits.velocity = p.velocity;
  limits.acceleration = p.acceleration;
  limits.jerk = p.jerk;
  limits.torque.setOnes();
  for (int k = 0; k < 500; ++k) {
    coglab_rt::Interpolator interpolator(limits);
    interpolator.reset(random.posture(0.3));
    JointVector request = random.joints(3.0), last = JointVector::Zero();
    for (int i = 0; i < 800; ++i) {
      if (i % 100 == 99 && k % 2 == 0) request = random.joints(3.0);
      const JointVector q = interpolator.position();
      GuardResult result;
      guard.limit(robot().evaluate(q), q, request, result);
      // One cycle late, as from another thread.
      interpolator.step(last, kCycle);
      last = result.velocity;
      ASSERT_LE((interpolator.position() - p.upper_position).maxCoeff(), 0.0) << k;
      ASSERT_LE((p.lower_position - interpolator.position()).maxCoeff(), 0.0) << k;
    }
  }
}

TEST(Guard, AJointAtItsStopWithAVerySmallRequestDoesNotStopTheArm) {
  GuardParameters p = armLimits();
  p.workspace = everywhere();
  Guard guard(p, robot());
  JointVector q = JointVector::Zero(), request = JointVector::Zero();
  q[3] = p.upper_position[3];  // beyond its margin, as after limits were narrowed
  request[0] = 0.3;
  for (const double outward : {1e-12, 1e-9, 1e-6, 2e-4}) {
    request[3] = outward;
    GuardResult result;
    guard.limit(robot().evaluate(q), q, request, result);
    EXPECT_EQ(result.scale, 1.0) << outward;
    EXPECT_EQ(result.velocity[0], 0.3) << outward;
    EXPECT_EQ(result.velocity[3], 0.0) << outward;
  }
  request[3] = 0.01;  // this is a share of the motion
  GuardResult result;
  guard.limit(robot().evaluate(q), q, request, result);
  EXPECT_EQ(result.scale, 0.0);
}

TEST(Guard, ANanRequestGivesStandstill) {
  Guard guard(armLimits(), robot());
  JointVector q = JointVector::Zero(), request = JointVector::Constant(0.1);
  request[2] = std::nan("");
  GuardResult result;
  guard.limit(robot().evaluate(q), q, request, result);
  EXPECT_TRUE(result.velocity.isZero(0.0));
  EXPECT_EQ(result.reason, GuardReason::NotFinite);
  request[2] = std::numeric_limits<double>::infinity();
  guard.limit(robot().evaluate(q), q, request, result);
  EXPECT_TRUE(result.velocity.isZero(0.0));
  q[0] = std::nan("");
  guard.limit(robot().evaluate(JointVector::Zero()), q, JointVector::Zero(), result);
  EXPECT_EQ(result.reason, GuardReason::NotFinite);
}

TEST(Guard, KeepsTheHandInTheWorkspaceAndTheArmFromStretching) {
  Random random(3);
  GuardParameters p = armLimits();
  p.workspace.box_min = Vector3(-0.6, -0.6, 0.05);
  p.workspace.box_max = Vector3(0.6, 0.6, 1.0);
  Guard guard(p, robot());
  const Workspace& workspace = guard.workspace();
  int inside = 0;
  for (int k = 0; k < 400; ++k) {
    JointVector q = random.posture(0.2);
    std::array<Workspace::Margin, Workspace::kBorders> margins;
    const auto smallest = [&] {
      workspace.margins(robot(), robot().evaluate(q), JointVector::Zero(), margins);
      double least = 1e9;
      for (const auto& margin : margins) least = std::min(least, margin.distance);
      return least;
    };
    if (smallest() < 0.02) continue;
    ++inside;
    const JointVector request = random.joints(1.5);
    for (int i = 0; i < 400; ++i) {
      GuardResult result;
      guard.limit(robot().evaluate(q), q, request, result);
      q += kCycle * result.velocity;
      ASSERT_GT(smallest(), -1e-3);
    }
  }
  EXPECT_GT(inside, 50);
}

TEST(Guard, AllowsMotionBackInside) {
  GuardParameters p = armLimits();
  p.workspace.box_max.z() = 0.5;  // the stretched arm is far above
  p.workspace.max_stretch = 1.0;
  Guard guard(p, robot());
  JointVector q = JointVector::Zero(), request = JointVector::Zero();
  q[1] = 0.5;
  q[3] = -1.0;
  const ChainState state = robot().evaluate(q);
  ASSERT_GT(state.tool.position.z(), 0.5);
  request[1] = state.jacobian(2, 1) > 0.0 ? 0.3 : -0.3;
  GuardResult result;
  guard.limit(state, q, request, result);
  EXPECT_EQ(result.scale, 0.0);
  EXPECT_EQ(result.border, WorkspaceBorder::BoxMax);
  guard.limit(state, q, -request, result);
  EXPECT_EQ(result.scale, 1.0);
}

TEST(Guard, RefusesBadLimits) {
  GuardParameters p = armLimits();
  p.velocity[2] = 0.0;
  EXPECT_THROW(Guard(p, robot()), std::invalid_argument);
  p = armLimits();
  p.lower_position[5] = 3.0;
  try {
    Guard(p, robot());
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("lwr_a5"), std::string::npos) << error.what();
  }
  p = armLimits();
  p.hand_speed = -1.0;
  EXPECT_THROW(Guard(p, robot()), std::invalid_argument);
}

TEST(Workspace, ProjectsGoalsToTheNearestAllowedPoint) {
  Random random(4);
  const Workspace workspace;
  for (int k = 0; k < 100000; ++k) {
    const Vector3 point = random.point(2.5);
    const Vector3 projected = workspace.project(point);
    ASSERT_TRUE(workspace.contains(projected)) << projected.transpose();
    ASSERT_TRUE(!workspace.contains(point) || point == projected);
  }
  EXPECT_EQ(workspace.violated(Vector3(0, 0, -1)), WorkspaceBorder::BoxMin);
  EXPECT_EQ(workspace.violated(Vector3(0, 2, 1)), WorkspaceBorder::BoxMax);
  EXPECT_EQ(workspace.violated(Vector3(0.1, 0, 0.2)), WorkspaceBorder::BaseSphere);
  EXPECT_EQ(workspace.violated(Vector3(std::nan(""), 0, 0.2)), WorkspaceBorder::BoxMin);
}

TEST(Workspace, MarginRatesAreDerivatives) {
  Random random(5);
  Guard guard(armLimits(), robot());
  for (int k = 0; k < 2000; ++k) {
    const JointVector q = random.posture(0.3), velocity = random.joints(1.0);
    std::array<Workspace::Margin, Workspace::kBorders> now, later;
    const double h = 1e-6;
    guard.workspace().margins(robot(), robot().evaluate(q), velocity, now);
    guard.workspace().margins(robot(), robot().evaluate(q + h * velocity), velocity, later);
    for (int i = 0; i < Workspace::kBorders; ++i) {
      ASSERT_NEAR((later[i].distance - now[i].distance) / h, now[i].rate, 1e-4) << i;
    }
  }
}

TEST(Workspace, RefusesAnEmptyOne) {
  WorkspaceParameters p;
  p.box_min.z() = 2.0;
  EXPECT_THROW(Workspace(p, 0.79), std::invalid_argument);
  p = {};
  p.base_radius = 9.0;
  EXPECT_THROW(Workspace(p, 0.79), std::invalid_argument);
  p = {};
  p.max_stretch = 0.0;
  EXPECT_THROW(Workspace(p, 0.79), std::invalid_argument);
}

TEST(PhaseGovernor, FollowsTheSpeedScaleWithoutSteps) {
  PhaseGovernor governor;
  double last = governor.rate();
  for (int i = 0; i < 400; ++i) {
    const double rate = governor.update(kCycle, i < 200 ? 0.0 : 0.7, 1.0);
    EXPECT_LE(std::abs(rate - last), 10.0 * kCycle + 1e-12);
    last = rate;
    if (i == 199) {
      EXPECT_EQ(rate, 0.0);
    }
  }
  EXPECT_NEAR(last, 0.7, 1e-12);
  EXPECT_THROW(PhaseGovernor(0.0, 1.0), std::invalid_argument);
}

TEST(PhaseGovernor, WaitsForAnArmThatIsLimited) {
  // The limits allow 0.4 of the motion's speed at rate 1.
  PhaseGovernor governor;
  double scale = 1.0;
  for (int i = 0; i < 400; ++i) {
    const double rate = governor.update(kCycle, 1.0, scale);
    scale = std::min(1.0, 0.4 / rate);
  }
  EXPECT_NEAR(governor.rate(), 0.4, 0.02);
}
