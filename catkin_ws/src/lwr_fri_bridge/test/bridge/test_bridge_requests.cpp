/// Requests to the bridge, and its state for other threads.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::drive;
using test::runEvent;

OutcomeCode codeOf(Cell& cell, const char* event) {
  return runEvent(cell.bridge, cell.robot, event).code;
}

TEST(Requests, NothingBeginsWhileSomethingElseIsInProgress) {
  Cell cell;
  cell.robot.obeys = false;
  cell.run(3);
  const std::uint32_t start = cell.bridge.submit("start");
  cell.run(1);
  EXPECT_TRUE(cell.bridge.snapshot().request_busy);
  EXPECT_EQ(codeOf(cell, "start"), OutcomeCode::Busy);
  EXPECT_EQ(codeOf(cell, "joint_impedance"), OutcomeCode::Busy);
  EXPECT_EQ(cell.bridge.snapshot().mode.strategy, fri::ControlStrategy::Position);
  EXPECT_EQ(cell.bridge.outcome(start).code, OutcomeCode::Pending);
  const std::uint32_t stop = cell.bridge.submit("stop");
  cell.run(1);
  EXPECT_EQ(cell.bridge.outcome(start).code, OutcomeCode::Interrupted);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopping);
  EXPECT_EQ(codeOf(cell, "stop"), OutcomeCode::Busy);
  EXPECT_EQ(codeOf(cell, "start"), OutcomeCode::Busy);
  cell.run(110);
  EXPECT_EQ(cell.bridge.outcome(stop).code, OutcomeCode::Done);
  EXPECT_FALSE(cell.bridge.snapshot().request_busy);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Monitor);
}

TEST(Requests, TheFirstOfAFullQueueAreServed) {
  Bridge bridge(defaultConfig());
  for (int i = 0; i < 18; ++i) bridge.submit(i == 16 ? "stop" : "hold");
  EXPECT_EQ(bridge.snapshot().counters.requests_dropped, 2U);
  const Outcome dropped = bridge.outcome(17);
  EXPECT_EQ(dropped.code, OutcomeCode::NotServed);
  EXPECT_EQ(dropped.kind, EventKind::Stop);
  EXPECT_EQ(dropped.ticket, 17U);
  bridge.idle(1'000'000'000);
  for (std::uint32_t ticket = 1; ticket <= 16; ++ticket)
    EXPECT_EQ(bridge.outcome(ticket).code, OutcomeCode::Done) << ticket;
}

/// The arm has three seconds to come to rest; then monitor mode is requested anyway.
TEST(Requests, AStopDoesNotWaitForRestForever) {
  BridgeConfig config = defaultConfig();
  config.limits.acceleration.setConstant(0.05);
  config.limits.jerk.setConstant(0.5);
  Cell cell(0.005, config);
  cell.start();
  cell.runDriven(1400, Vector7::Constant(0.3));
  ASSERT_GT(cell.bridge.snapshot().sample.commanded_velocity[0], 0.25);
  cell.bridge.submit("stop");
  int asked_after = 0;
  for (; asked_after < 1000 && cell.robot.answer.krl.ints[0] != 2; ++asked_after) cell.run(1);
  EXPECT_NEAR(asked_after * 0.005, 3.0, 0.02);
  EXPECT_GT(cell.bridge.snapshot().sample.commanded_velocity[0], 0.05);
}

/// Silence counts from the last datagram: 0.25 s, or five cycles where they are longer.
TEST(Requests, SilenceIsReportedAfterItsTimeLimit) {
  for (const double period : {0.005, 0.1}) {
    Cell cell(period);
    cell.run(3);
    const std::int64_t last = cell.robot.now();
    const double limit = period < 0.1 ? 0.25 : 0.5;
    EXPECT_DOUBLE_EQ(cell.bridge.cycleTime(), period);
    cell.bridge.idle(last + std::llround(1e9 * (limit - 0.001)));
    EXPECT_TRUE(cell.bridge.connected());
    EXPECT_EQ(cell.bridge.snapshot().state, fri::FriState::Monitor);
    cell.bridge.idle(last + std::llround(1e9 * (limit + 0.001)));
    EXPECT_FALSE(cell.bridge.connected());
    const Snapshot s = cell.bridge.snapshot();
    EXPECT_EQ(s.supervisor, SupervisorState::Disconnected);
    EXPECT_EQ(s.state, fri::FriState::Off);
    EXPECT_EQ(s.quality, fri::Quality::Unacceptable);
    cell.robot.setCounter(9);  // whatever it counts now, and wherever it was moved
    cell.robot.setMeasured(cell.robot.measured() + Vector7::Constant(0.5));
    EXPECT_TRUE(cell.robot.cycle(cell.bridge));
    EXPECT_TRUE(cell.bridge.connected());
    EXPECT_TRUE(cell.bridge.snapshot().sample.velocity.isZero());
    EXPECT_EQ(cell.bridge.snapshot().session.restarts, 0U);
  }
}

std::vector<StateView> toldBy(Bridge& bridge) {
  std::vector<StateView> told;
  for (StateView view; bridge.nextStateChange(view);) told.push_back(view);
  return told;
}

TEST(BridgeView, EachStateIsReportedOnceFromTheStart) {
  Cell cell;
  std::vector<StateView> told = toldBy(cell.bridge);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].supervisor, SupervisorState::Disconnected);
  cell.run(20);
  told = toldBy(cell.bridge);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].supervisor, SupervisorState::Monitor);
  EXPECT_EQ(told[0].block, MotionBlock::Monitor);
  EXPECT_EQ(told[0].state, fri::FriState::Monitor);
  EXPECT_EQ(told[0].quality, fri::Quality::Perfect);
  EXPECT_EQ(told[0].control, fri::ControlStrategy::Position);
  EXPECT_EQ(told[0].power, 0x7F);
  EXPECT_EQ(told[0].blocking_joint, -1);
  EXPECT_DOUBLE_EQ(told[0].cycle_time, 0.005);
  cell.bridge.submit("hold");
  cell.run(20);
  told = toldBy(cell.bridge);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_TRUE(told[0].hold_latched);
  EXPECT_EQ(told[0].supervisor, SupervisorState::Holding);
}

/// A bridge that starts with a controller in command mode uses the controller's strategy, because
/// the flags may not change there.
TEST(BridgeView, AnExistingCommandModeGetsTheFlagsOfItsStrategy) {
  for (const auto& [control, flags] :
       {std::pair{fri::ControlStrategy::JointImpedance, 0x0035U},
        std::pair{fri::ControlStrategy::CartesianImpedance, 0x3500U}}) {
    Cell cell;
    cell.robot.state = fri::FriState::Command;
    cell.robot.control = control;
    cell.run(3);
    EXPECT_EQ(cell.robot.answer.flags, flags);
    EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "start").success());
    cell.run(2);
    EXPECT_EQ(cell.robot.answer.flags, flags);
    cell.robot.state = fri::FriState::Monitor;
    cell.run(2);
    EXPECT_EQ(cell.robot.answer.flags, 0x0001U);
  }
  Cell monitor;  // in monitor mode it tells its own, whatever is reported
  monitor.robot.control = fri::ControlStrategy::JointImpedance;
  monitor.run(2);
  EXPECT_EQ(monitor.robot.answer.flags, 0x0001U);
}

/// Age of a command on both sides of its limit, and at long periods of two and a half cycles.
TEST(BridgeView, CommandAgeLimitsForFutureStampsAndLongPeriods) {
  const auto follows = [](double period, double age) {
    Cell cell(period);
    cell.start();
    RobotSample sample;
    cell.bridge.mailboxes().newestSample(sample);
    const std::int64_t now = cell.robot.now() + std::llround(1e9 * period);
    cell.bridge.mailboxes().sendVelocity(
        {Vector7::Constant(0.2), now - std::llround(1e9 * age), sample.motion_epoch});
    cell.run(1);
    return !cell.bridge.snapshot().sample.commanded_velocity.isZero();
  };
  EXPECT_TRUE(follows(0.005, 0.049));
  EXPECT_TRUE(follows(0.005, 0.05));  // the limit is still within
  EXPECT_TRUE(follows(0.005, -0.05));
  EXPECT_FALSE(follows(0.005, 0.051));
  EXPECT_TRUE(follows(0.005, -0.049));
  EXPECT_FALSE(follows(0.005, -0.051));
  EXPECT_TRUE(follows(0.1, 0.249));
  EXPECT_FALSE(follows(0.1, 0.251));
}

/// Quality and drive errors do not end command mode, so they report no cause of a loss.
TEST(BridgeView, PoorQualityIsNoLossOfCommandMode) {
  Cell cell;
  cell.start();
  cell.robot.quality = fri::Quality::Unacceptable;
  cell.run(3);
  EXPECT_EQ(cell.bridge.snapshot().fall_backs, 1U);
  EXPECT_EQ(cell.bridge.snapshot().loss.cause, LossCause::None);
  Cell anew;
  anew.start();
  anew.robot.setCounter(40000);
  anew.run(30);
  EXPECT_EQ(anew.bridge.snapshot().fall_backs, 1U);
  EXPECT_EQ(anew.bridge.snapshot().loss.cause, LossCause::BeganAnew);
}

}  // namespace
}  // namespace lwr_fri_bridge
