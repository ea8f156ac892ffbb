/// Control modes of the bridge and its parameters, in lockstep with a small controller.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::drive;
using test::runEvent;

TEST(Bridge, StrategyChangesInMonitorModeOnly) {
  Cell cell;
  cell.start();
  const Outcome refused = runEvent(cell.bridge, cell.robot, "joint_impedance");
  EXPECT_EQ(refused.code, OutcomeCode::InCommandMode);
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.flags, 0x0001U);
  EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "stop").success());
  EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "joint_impedance").success());
  cell.start();
  EXPECT_EQ(cell.robot.control, fri::ControlStrategy::JointImpedance);
  EXPECT_EQ(cell.robot.answer.flags, 0x0035U);
}

/// Flags of the answer stay those of the entry for every request in command mode.
TEST(Bridge, FlagsStayInCommandModeForEveryRequest) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    Cell cell;
    cell.run(2);
    ASSERT_TRUE(runEvent(cell.bridge, cell.robot, mode).success());
    cell.start();
    const std::uint32_t flags = cell.robot.answer.flags;
    EXPECT_EQ(flags, fri::flagsFor(cell.robot.control));
    for (const char* event : {"position", "joint_impedance stiffness 50", "cartesian_impedance",
                              "start", "hold", "reset", "jump"}) {
      try {
        cell.bridge.submit(event);
      } catch (const std::invalid_argument&) {  // the unknown one
      }
      for (int i = 0; i < 20; ++i) {
        drive(cell.bridge, cell.robot, Vector7::Constant(0.1));
        cell.robot.cycle(cell.bridge);
        ASSERT_EQ(cell.robot.answer.flags, flags) << mode << ", " << event;
        ASSERT_EQ(cell.robot.state, fri::FriState::Command);
      }
    }
  }
}

/// Nothing adds torques or forces, in no mode and at no time.
TEST(Bridge, AddedTorquesAndForcesStayZero) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    Cell cell;
    cell.run(2);
    ASSERT_TRUE(runEvent(cell.bridge, cell.robot, mode).success());
    cell.start();
    for (int i = 0; i < 300; ++i) {
      if (i == 100) cell.bridge.submit("hold");
      if (i == 150) cell.bridge.submit("reset");
      if (i == 250) cell.bridge.submit("stop");
      drive(cell.bridge, cell.robot, Vector7::Constant(0.3));
      cell.robot.cycle(cell.bridge, i % 37 == 0, i % 41 == 0);
      for (const float torque : cell.robot.answer.joint_torque) ASSERT_EQ(torque, 0.0F);
      for (const float force : cell.robot.answer.cartesian_force) ASSERT_EQ(force, 0.0F);
    }
  }
}

TEST(Bridge, EveryStrategyFollows) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    Cell cell;
    cell.run(2);
    ASSERT_TRUE(runEvent(cell.bridge, cell.robot, mode).success());
    cell.start();
    const float x = cell.robot.answer.cartesian_frame[3], y = cell.robot.answer.cartesian_frame[7];
    Vector7 velocity = Vector7::Zero();
    velocity[0] = 0.3;
    cell.runDriven(100, velocity);
    EXPECT_GT(cell.bridge.snapshot().sample.commanded_position[0], 0.1 + 0.1) << mode;
    if (std::string(mode) == "cartesian_impedance") {
      // Joint 1 turns about the vertical: the frame turns with it.
      const double angle = cell.bridge.snapshot().sample.commanded_position[0] - 0.1;
      EXPECT_NEAR(cell.robot.answer.cartesian_frame[3], x * std::cos(angle) - y * std::sin(angle),
                  1e-3);
      EXPECT_NEAR(cell.robot.answer.cartesian_frame[7], x * std::sin(angle) + y * std::cos(angle),
                  1e-3);
    }
  }
}

/// A person guides the arm. At the end of the mode nothing may pull it back.
TEST(Bridge, SetPointFollowsAnArmThatIsLedByHand) {
  Cell cell;
  cell.run(2);
  ASSERT_TRUE(
      runEvent(cell.bridge, cell.robot, "joint_impedance stiffness 0.01 damping 0.3").success());
  cell.start();
  cell.robot.blocked = true;  // the hand decides where the arm is
  Vector7 arm = cell.robot.measured();
  for (int i = 0; i < 400; ++i) {  // 0.8 rad of joint 1 in 2 s: farther than the leash
    arm[0] += 0.002;
    cell.robot.setMeasured(arm);
    cell.robot.cycle(cell.bridge);
    ASSERT_LT(std::abs(arm[0] - cell.bridge.snapshot().sample.commanded_position[0]), 0.05) << i;
  }
  cell.run(100);
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_position[0], arm[0], 1e-4);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
}

TEST(Bridge, RefusesLimitsOutOfRangeByName) {
  struct Case {
    const char* name;
    Vector7 JointLimits::*what;
    double value;
  };
  for (const Case& one : {Case{"limits.velocity", &JointLimits::velocity, 11.0},
                          Case{"limits.acceleration", &JointLimits::acceleration, 2000.0},
                          Case{"limits.jerk", &JointLimits::jerk, 0.01}}) {
    for (const double value : {one.value, std::nan("")}) {
      BridgeConfig config = defaultConfig();
      (config.limits.*one.what)[3] = value;
      try {
        Bridge bridge(config);
        ADD_FAILURE() << one.name << " accepted";
      } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find(one.name), std::string::npos) << error.what();
      }
    }
  }
}

/// Planners keep the margin of the table. A bridge with a wider margin would stop accepted motions.
TEST(Bridge, KeepsNoWiderMarginThanTheTable) {
  BridgeConfig config = defaultConfig();
  for (const double margin : {config.limits.position_margin, 0.5 * config.limits.position_margin}) {
    config.position_margin = margin;
    EXPECT_NO_THROW(Bridge{config}) << margin;
  }
  config.position_margin = config.limits.position_margin + 0.001;
  EXPECT_THROW(Bridge{config}, std::invalid_argument);
}

TEST(Bridge, RefusesATableOfOtherJointsThanItsArmHas) {
  BridgeConfig config = defaultConfig();
  std::swap(config.limits.names[1], config.limits.names[2]);
  EXPECT_THROW(Bridge{config}, std::invalid_argument);
}

}  // namespace
}  // namespace lwr_fri_bridge
