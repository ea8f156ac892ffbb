/// SetPointLeash: a blocked arm does not store a leap.
#include <gtest/gtest.h>

#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

using test::defaultConfig;
using test::drive;
using test::SmallController;

struct Blocked {
  Blocked(const char* mode, double speed) : bridge(defaultConfig()), robot(0.005) {
    for (int i = 0; i < 3; ++i) robot.cycle(bridge);
    EXPECT_TRUE(test::runEvent(bridge, robot, mode).success());
    EXPECT_TRUE(test::runEvent(bridge, robot, "start").success());
    robot.cycle(bridge);
    velocity[1] = speed;
    push(100);
    robot.blocked = true;
    blocked_at = robot.measured();
  }
  void push(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      drive(bridge, robot, velocity);
      robot.cycle(bridge);
      ahead = std::max(ahead, (robot.setPoint() - robot.measured()).cwiseAbs().maxCoeff());
    }
  }
  double stored() const { return (robot.setPoint() - robot.measured()).cwiseAbs().maxCoeff(); }
  Bridge bridge;
  SmallController robot;
  Vector7 velocity = Vector7::Zero();
  Vector7 blocked_at;
  double ahead = 0.0;
};

TEST(Leash, RelaxesABlockedArmInEveryMode) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    for (const double speed : {0.1, 0.5, 1.5, -1.5}) {
      Blocked cell(mode, speed);
      cell.push(1000);  // 5 s against the block
      const double leash = std::string(mode) == "position" ? 0.05 : 0.10;
      const double v = std::abs(speed);
      EXPECT_LE(cell.ahead, leash + 1.1 * coglab_rt::brakingDistance(v, 10.0, 500.0) + 0.01 * v)
          << mode << speed;
      EXPECT_LE(cell.stored(), 2e-3) << mode << speed;
      const Snapshot s = cell.bridge.snapshot();
      EXPECT_EQ(s.counters.leash_trips, 1U);
      EXPECT_EQ(s.sample.block, MotionBlock::Leashed);
      EXPECT_EQ(s.sample.blocking_joint, 1);
    }
  }
}

/// Lengths by mode and stiffness, worked out by hand from the documented rule.
TEST(Leash, GrowsAsTheStiffnessFalls) {
  const LeashLengths lengths;
  ControlMode mode;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.05)));
  mode.strategy = fri::ControlStrategy::JointImpedance;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.10)));  // 1000 Nm/rad
  mode.joint_stiffness.setConstant(40.0);
  Vector7 expected;
  expected << 0.25, 0.25, 0.15, 0.15, 0.10, 0.10, 0.10;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(expected));
  mode.joint_stiffness.setConstant(0.01);
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.5)));  // never longer
  mode.strategy = fri::ControlStrategy::CartesianImpedance;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.10)));  // 2000 N/m, 200 Nm/rad
  mode.cartesian_stiffness << 500, 500, 100, 50, 50, 20;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.25 + 0.05)));
  mode.strategy = fri::ControlStrategy::Position;
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(0.05)));
}

/// A soft arm sags under what it holds, friction holds it back: no block, it goes on. A stiff one
/// that lies back as far is blocked.
TEST(Leash, ASoftArmThatSagsIsNotBlocked) {
  for (const bool soft : {true, false}) {
    Bridge bridge(defaultConfig());
    SmallController robot(0.005);
    for (int i = 0; i < 3; ++i) robot.cycle(bridge);
    const std::string mode = soft ? "joint_impedance stiffness 30" : "joint_impedance";
    ASSERT_TRUE(test::runEvent(bridge, robot, mode).success());
    ASSERT_TRUE(test::runEvent(bridge, robot, "start").success());
    robot.blocked = true;  // the measured position is set here
    Vector7 sag = Vector7::Zero(), velocity = Vector7::Zero();
    sag[1] = 0.2;  // 6 Nm at 30 Nm/rad
    velocity[1] = 0.3;
    const double before = robot.setPoint()[1];
    for (int i = 0; i < 300; ++i) {
      robot.setMeasured(robot.setPoint() - sag);
      drive(bridge, robot, velocity);
      robot.cycle(bridge);
    }
    EXPECT_EQ(bridge.snapshot().counters.leash_trips, soft ? 0U : 1U);
    EXPECT_EQ(robot.setPoint()[1] > before + 0.3, soft);
  }
}

TEST(Leash, NeedsANewRequest) {
  Blocked cell("position", 0.5);
  cell.push(1000);
  cell.robot.blocked = false;
  const double before = cell.robot.setPoint()[1];
  cell.push(100);  // still the old request
  EXPECT_NEAR(cell.robot.setPoint()[1], before, 1e-3);
  cell.velocity.setZero();
  cell.push(5);
  EXPECT_EQ(cell.bridge.snapshot().sample.block, MotionBlock::None);
  cell.velocity[1] = 0.5;
  cell.push(100);
  EXPECT_GT(cell.robot.setPoint()[1], before + 0.1);
}

TEST(Leash, MotionBackIsFollowedOnceTheSetPointHasReturned) {
  Blocked cell("position", 0.5);
  cell.push(1000);
  cell.velocity[1] = -0.3;
  cell.robot.blocked = false;
  cell.push(200);
  EXPECT_LT(cell.robot.setPoint()[1], cell.blocked_at[1] - 0.1);
}

TEST(Leash, AnArmThatIsPushedOrSagsDoesNotDragTheSetPoint) {
  Bridge bridge(defaultConfig());
  SmallController robot(0.005);
  for (int i = 0; i < 3; ++i) robot.cycle(bridge);
  ASSERT_TRUE(test::runEvent(bridge, robot, "joint_impedance").success());
  ASSERT_TRUE(test::runEvent(bridge, robot, "start").success());
  const Vector7 set_point = robot.setPoint();
  robot.blocked = true;
  for (int i = 0; i < 400; ++i) {
    robot.setMeasured(set_point - Vector7::Constant(0.001 * i));
    drive(bridge, robot, Vector7::Zero());
    robot.cycle(bridge);
  }
  EXPECT_TRUE(robot.setPoint().isApprox(set_point, 1e-7));
  EXPECT_EQ(bridge.snapshot().counters.leash_trips, 0U);
}

}  // namespace
}  // namespace lwr_fri_bridge
