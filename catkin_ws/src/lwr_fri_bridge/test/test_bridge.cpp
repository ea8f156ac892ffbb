/// The bridge in lockstep with a small controller: what Table 1, the supervisor and "failure has a
/// meaning" promise.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <sstream>
#include <vector>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::drive;
using test::expectMirror;
using test::runEvent;

TEST(Bridge, mirrorsTheSetPointInMonitorModeAndWithoutPower) {
  Cell cell;
  cell.run(5);
  expectMirror(cell, cell.robot.setPoint());
  // The commanded position counts, not the measured one.
  cell.robot.setMeasured(cell.robot.setPoint() + Vector7::Constant(0.01));
  cell.run(1);
  expectMirror(cell, cell.robot.setPoint());

  cell.start();
  cell.robot.power = 0x3F;
  cell.runDriven(20, Vector7::Constant(0.3));
  expectMirror(cell, cell.robot.setPoint());
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopped);
}

TEST(Bridge, answersWithHeaderAndFlags) {
  Cell cell;
  cell.robot.setCounter(65534);
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.header.reflected, 65535);
  EXPECT_EQ(cell.robot.answer.header.size, 376);
  EXPECT_EQ(cell.robot.answer.header.id, 0x1005);
  const std::uint16_t first = cell.robot.answer.header.counter;
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.header.reflected, 0);
  EXPECT_EQ(cell.robot.answer.header.counter, static_cast<std::uint16_t>(first + 1));
  EXPECT_EQ(cell.robot.answer.flags, 0x0001U);
  EXPECT_TRUE(
      runEvent(cell.bridge, cell.robot, "joint_impedance stiffness 500 damping 0.5").success());
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.flags, 0x0035U);
  EXPECT_FLOAT_EQ(cell.robot.answer.joint_stiffness[3], 500.0F);
  EXPECT_TRUE(
      runEvent(cell.bridge, cell.robot, "cartesian_impedance stiffness 1 2 3 4 5 6").success());
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.flags, 0x3500U);
  const float wire[6] = {1, 2, 3, 6, 5, 4};
  for (int i = 0; i < 6; ++i) EXPECT_FLOAT_EQ(cell.robot.answer.cartesian_stiffness[i], wire[i]);
  for (int i = 0; i < 7; ++i) EXPECT_EQ(cell.robot.answer.joint_torque[i], 0.0F);
}

TEST(Bridge, followsVelocitiesAfterStartOnly) {
  Cell cell;
  cell.run(3);
  cell.robot.state = fri::FriState::Command;  // nobody asked
  const Vector7 before = cell.robot.setPoint();
  cell.runDriven(100, Vector7::Constant(0.2));
  EXPECT_TRUE(cell.robot.setPoint().isApprox(before, 1e-6));
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopped);
  EXPECT_EQ(cell.bridge.snapshot().sample.block, MotionBlock::NotStarted);

  const Outcome outcome = runEvent(cell.bridge, cell.robot, "start");
  ASSERT_TRUE(outcome.success()) << describe(outcome);
  cell.run(2);
  cell.runDriven(200, Vector7::Constant(0.2));
  EXPECT_NEAR(cell.robot.setPoint()[0] - before[0], 0.2, 0.01);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
}

TEST(Bridge, strategyChangesInMonitorModeOnly) {
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

/// Flags of the answer stay those of the entry, whatever is asked for in command mode.
TEST(Bridge, flagsStayInCommandModeWhateverIsAsked) {
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
TEST(Bridge, addedTorquesAndForcesStayZero) {
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

TEST(Bridge, everyStrategyFollows) {
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

TEST(Bridge, holdBrakesLatchesAndNeedsReset) {
  Cell cell;
  cell.start();
  Vector7 velocity = Vector7::Constant(0.5);
  cell.runDriven(60, velocity);
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.5, 1e-9);
  const std::uint32_t ticket = cell.bridge.submit("hold");
  cell.runDriven(60, velocity);
  EXPECT_TRUE(cell.bridge.outcome(ticket).success());
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Holding);
  EXPECT_EQ(runEvent(cell.bridge, cell.robot, "start").code, OutcomeCode::Held);
  const Vector7 held = cell.robot.setPoint();
  cell.runDriven(50, velocity);
  EXPECT_TRUE(cell.robot.setPoint().isApprox(held, 1e-7));
  EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "reset").success());
  cell.run(2);
  cell.runDriven(60, velocity);
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.5, 1e-9);
}

TEST(Bridge, commandsBeforeThePermissionDoNotCount) {
  Cell cell;
  cell.run(3);
  RobotSample sample;
  cell.bridge.port().newestSample(sample);
  cell.start();
  cell.bridge.port().sendVelocity({Vector7::Constant(0.5), cell.robot.now(), sample.motion_epoch});
  cell.run(5);
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
  EXPECT_GE(cell.bridge.snapshot().counters.commands_old_epoch, 1U);
}

TEST(Bridge, stopBrakesThenAsksForMonitorMode) {
  Cell cell;
  cell.start();
  const Vector7 velocity = Vector7::Constant(1.0);
  cell.runDriven(100, velocity);
  const std::uint32_t ticket = cell.bridge.submit("stop");
  bool asked_while_moving = false;
  double largest_change = 0.0;
  Vector7 last = cell.bridge.snapshot().sample.commanded_velocity;
  for (int i = 0; i < 200; ++i) {
    drive(cell.bridge, cell.robot, velocity);
    cell.robot.cycle(cell.bridge);
    const Vector7 now = cell.bridge.snapshot().sample.commanded_velocity;
    if (cell.robot.answer.krl.ints[0] == 2 && !now.isZero()) asked_while_moving = true;
    largest_change = std::max(largest_change, (now - last).cwiseAbs().maxCoeff());
    last = now;
  }
  EXPECT_FALSE(asked_while_moving);
  EXPECT_LE(largest_change, 10.0 * 0.005 * (1 + 1e-9));
  EXPECT_TRUE(cell.bridge.outcome(ticket).success());
  EXPECT_EQ(cell.robot.state, fri::FriState::Monitor);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Monitor);
}

TEST(Bridge, requestsEndWithinTheirTimeLimits) {
  Cell cell;
  cell.robot.obeys = false;
  cell.run(3);
  const Outcome outcome = runEvent(cell.bridge, cell.robot, "start");
  EXPECT_EQ(outcome.code, OutcomeCode::NotEntered);
  EXPECT_NEAR(outcome.waited, 10.0, 0.1);
  EXPECT_NE(describe(outcome).find("pendant"), std::string::npos);

  cell.robot.obeys = true;
  cell.robot.quality = fri::Quality::Bad;
  EXPECT_EQ(runEvent(cell.bridge, cell.robot, "start").code, OutcomeCode::PoorQuality);
  cell.robot.quality = fri::Quality::Perfect;
  cell.start();
  cell.robot.obeys = false;
  const Outcome stop = runEvent(cell.bridge, cell.robot, "stop");
  EXPECT_EQ(stop.code, OutcomeCode::NotLeft);
  EXPECT_NEAR(stop.waited, 2.0, 0.1);
}

TEST(Bridge, startWithTheWrongStrategyIsNotAccepted) {
  Cell cell;
  cell.run(3);
  const std::uint32_t ticket = cell.bridge.submit("start");
  cell.robot.obeys = false;
  cell.run(2);
  cell.robot.state = fri::FriState::Command;
  cell.robot.control = fri::ControlStrategy::JointImpedance;
  cell.run(2);
  EXPECT_EQ(cell.bridge.outcome(ticket).code, OutcomeCode::WrongStrategy);
  EXPECT_EQ(cell.robot.answer.krl.ints[0], 2);
  EXPECT_NE(cell.bridge.snapshot().supervisor, SupervisorState::Command);
}

TEST(Bridge, holdInterruptsAStart) {
  Cell cell;
  cell.robot.obeys = false;
  cell.run(3);
  const std::uint32_t start = cell.bridge.submit("start");
  cell.run(10);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Starting);
  cell.bridge.submit("hold");
  cell.run(1);
  EXPECT_EQ(cell.bridge.outcome(start).code, OutcomeCode::Interrupted);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Holding);
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.krl.ints[0], 2);
}

TEST(Bridge, fallBackLatchesUntilAnExplicitStart) {
  Cell cell;
  cell.start();
  cell.runDriven(60, Vector7::Constant(0.4));
  const std::uint32_t epoch = cell.bridge.snapshot().sample.motion_epoch;
  cell.robot.state = fri::FriState::Monitor;
  cell.run(3);
  expectMirror(cell, cell.robot.setPoint());
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopped);
  EXPECT_NE(cell.bridge.snapshot().sample.motion_epoch, epoch);
  EXPECT_EQ(cell.bridge.snapshot().fall_backs, 1U);
  cell.robot.state = fri::FriState::Command;
  const Vector7 before = cell.robot.setPoint();
  cell.runDriven(50, Vector7::Constant(0.4));
  EXPECT_TRUE(cell.robot.setPoint().isApprox(before, 1e-6));
  EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "start").success());
  cell.run(1);
  cell.runDriven(50, Vector7::Constant(0.4));
  EXPECT_GT(cell.robot.setPoint()[0], before[0] + 0.05);
}

TEST(Bridge, brakesWhenCommandsStopAndResumes) {
  Cell cell;
  cell.start();
  cell.runDriven(60, Vector7::Constant(0.4));
  cell.run(40);
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
  EXPECT_EQ(cell.bridge.snapshot().counters.command_timeouts, 1U);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
  cell.runDriven(60, Vector7::Constant(0.4));
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.4, 1e-9);
}

TEST(Bridge, keepsTheLastValidCommandWhenOneIsNotFinite) {
  Cell cell;
  cell.start();
  cell.runDriven(60, Vector7::Constant(0.4));
  Vector7 broken = Vector7::Constant(0.4);
  broken[5] = std::nan("");
  cell.runDriven(3, broken);
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[5], 0.4, 1e-9);
  EXPECT_EQ(cell.bridge.snapshot().counters.commands_invalid, 3U);
  cell.runDriven(60, broken);
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
}

TEST(Bridge, scalesTheWholeVectorToTheSpeedLimit) {
  Cell cell;
  cell.start();
  Vector7 velocity = Vector7::Constant(1.0);
  velocity[2] = 4.0;
  cell.runDriven(100, velocity);
  const Vector7 v = cell.bridge.snapshot().sample.commanded_velocity;
  const double limit = cell.bridge.config().limits.velocity[2];
  EXPECT_NEAR(v[2], limit, 1e-9);
  EXPECT_NEAR(v[5], limit / 4.0, 1e-9);
}

TEST(Bridge, silenceIsDisconnectionAndEndsRequests) {
  Cell cell;
  cell.start();
  cell.runDriven(20, Vector7::Constant(0.2));
  const std::uint32_t ticket = cell.bridge.submit("stop");
  std::int64_t now = cell.robot.now();
  for (int i = 0; i < 200; ++i) cell.bridge.idle(now += 10'000'000);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Disconnected);
  const Outcome stop = cell.bridge.outcome(ticket);
  EXPECT_EQ(stop.code, OutcomeCode::LostConnection);
  EXPECT_LE(stop.waited, 1.1);
  EXPECT_EQ(cell.bridge.snapshot().sample.block, MotionBlock::Disconnected);
}

TEST(Bridge, aNewBridgeStartsNothing) {
  Cell cell;
  cell.start();
  cell.runDriven(50, Vector7::Constant(0.2));
  // The process died and was started again while the controller is still in command mode.
  Bridge other(defaultConfig());
  for (int i = 0; i < 50; ++i) {
    RobotSample sample;
    other.port().newestSample(sample);
    other.port().sendVelocity({Vector7::Constant(0.5), cell.robot.now(), sample.motion_epoch});
    cell.robot.cycle(other);
  }
  EXPECT_TRUE(other.snapshot().sample.commanded_velocity.isZero());
  EXPECT_EQ(other.snapshot().supervisor, SupervisorState::Stopped);
  // The KRL program has lived on, with the numbers of the first bridge's requests.
  for (const char* event : {"start", "stop", "start", "stop"}) {
    const Outcome outcome = runEvent(other, cell.robot, event);
    EXPECT_TRUE(outcome.success()) << describe(outcome);
  }
  EXPECT_EQ(cell.robot.state, fri::FriState::Monitor);
}

TEST(Bridge, refusesParametersOutOfRangeByName) {
  struct Case {
    const char* name;
    double value;
    const char* range;
    std::function<void(BridgeConfig&, double)> set;
  };
  const std::vector<Case> cases = {
      {"tool_number", 17, "0..16",
       [](BridgeConfig& c, double v) { c.tool_number = static_cast<int>(v); }},
      {"position_margin", 0.6, "0..0.5", [](BridgeConfig& c, double v) { c.position_margin = v; }},
      {"set_point_leash/position", 3, "0.005..0.5",
       [](BridgeConfig& c, double v) { c.leash.position = v; }},
      {"set_point_leash/impedance", 0.001, "0.005..0.5",
       [](BridgeConfig& c, double v) { c.leash.impedance = v; }},
      {"set_point_leash/load", 71, "0..70", [](BridgeConfig& c, double v) { c.leash.load = v; }},
      {"velocity_filter_time", -1, "0..0.2",
       [](BridgeConfig& c, double v) { c.velocity_filter_time = v; }},
      {"command_timeout", 2, "0.005..1", [](BridgeConfig& c, double v) { c.command_timeout = v; }},
      {"topic_timeout", 2, "0.005..1", [](BridgeConfig& c, double v) { c.topic_timeout = v; }},
      {"receive_timeout", 6, "0.05..5", [](BridgeConfig& c, double v) { c.receive_timeout = v; }},
      {"start_timeout", 0.1, "0.5..120",
       [](BridgeConfig& c, double v) { c.requests.start_timeout = v; }},
      {"stop_timeout", 31, "0.1..30",
       [](BridgeConfig& c, double v) { c.requests.stop_timeout = v; }},
      {"silent_stop_timeout", 31, "0.1..30",
       [](BridgeConfig& c, double v) { c.requests.silent_stop_timeout = v; }},
      {"limits.velocity", 11, "0.001..10",
       [](BridgeConfig& c, double v) { c.limits.velocity[3] = v; }},
      {"limits.acceleration", 2000, "0.01..1000",
       [](BridgeConfig& c, double v) { c.limits.acceleration[3] = v; }},
      {"limits.jerk", 0.01, "0.1..1e+06", [](BridgeConfig& c, double v) { c.limits.jerk[3] = v; }}};
  for (const Case& one : cases) {
    for (const double value : {one.value, std::nan("")}) {
      if (std::isnan(value) && std::string(one.name) == "tool_number") continue;
      BridgeConfig config = defaultConfig();
      one.set(config, value);
      try {
        Bridge bridge(config);
        ADD_FAILURE() << one.name << " accepted";
      } catch (const std::invalid_argument& error) {
        std::ostringstream expected;
        expected << one.name << " = " << value << " is outside its range " << one.range;
        EXPECT_NE(std::string(error.what()).find(expected.str()), std::string::npos)
            << error.what() << " instead of " << expected.str();
      }
    }
  }
}

TEST(Bridge, theVelocitySourceIsSwitched) {
  Cell cell;
  cell.start();
  const auto topic = [&](double speed) {
    cell.bridge.sendTopicVelocity(
        {Vector7::Constant(speed), cell.robot.now(), cell.bridge.snapshot().sample.motion_epoch});
  };
  for (int i = 0; i < 50; ++i) {
    topic(0.3);
    cell.run(1);
  }
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());  // not the source
  cell.bridge.setVelocitySource(VelocitySource::Topic);
  for (int i = 0; i < 60; ++i) {
    topic(0.3);
    drive(cell.bridge, cell.robot, Vector7::Constant(-0.5));
    cell.run(1);
  }
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.3, 1e-9);
  cell.bridge.setVelocitySource(VelocitySource::ControlThread);
  cell.run(40);  // the last command of the topic does not go on
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
}

}  // namespace
}  // namespace lwr_fri_bridge
