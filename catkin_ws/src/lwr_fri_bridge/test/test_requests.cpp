/// Requests to the bridge: when each is refused, what an outcome tells, and who waits for what.
#include <gtest/gtest.h>

#include <cmath>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::runEvent;

OutcomeCode codeOf(Cell& cell, const char* event) {
  return runEvent(cell.bridge, cell.robot, event).code;
}

TEST(Requests, WhatIsThereAlreadyIsSaid) {
  Cell cell;
  cell.run(3);
  EXPECT_EQ(codeOf(cell, "reset"), OutcomeCode::AlreadyThere);
  EXPECT_EQ(codeOf(cell, "stop"), OutcomeCode::AlreadyThere);
  EXPECT_EQ(cell.robot.answer.krl.ints[0], 0);  // nothing was asked of the program
  EXPECT_EQ(codeOf(cell, "start"), OutcomeCode::Done);
  cell.run(1);
  EXPECT_EQ(codeOf(cell, "start"), OutcomeCode::AlreadyThere);
  EXPECT_EQ(codeOf(cell, "hold"), OutcomeCode::Done);
  EXPECT_EQ(codeOf(cell, "hold"), OutcomeCode::Done);
  EXPECT_EQ(codeOf(cell, "reset"), OutcomeCode::Done);
  EXPECT_EQ(codeOf(cell, "reset"), OutcomeCode::AlreadyThere);
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

TEST(Requests, AHoldRefusesStartsAndModes) {
  Cell cell;
  cell.run(3);
  ASSERT_EQ(codeOf(cell, "hold"), OutcomeCode::Done);
  EXPECT_TRUE(cell.bridge.snapshot().hold_latched);
  EXPECT_EQ(codeOf(cell, "start"), OutcomeCode::Held);
  EXPECT_EQ(codeOf(cell, "joint_impedance"), OutcomeCode::Held);
  EXPECT_EQ(cell.bridge.snapshot().mode.strategy, fri::ControlStrategy::Position);
  ASSERT_EQ(codeOf(cell, "reset"), OutcomeCode::Done);
  EXPECT_FALSE(cell.bridge.snapshot().hold_latched);
  EXPECT_EQ(codeOf(cell, "joint_impedance"), OutcomeCode::Done);
  EXPECT_EQ(cell.bridge.snapshot().mode.strategy, fri::ControlStrategy::JointImpedance);
}

TEST(Requests, WithoutAControllerThereIsNothingToStartOrStop) {
  Bridge bridge(defaultConfig());
  std::int64_t now = 1'000'000'000;
  const auto code = [&](const char* event) {
    const std::uint32_t ticket = bridge.submit(event);
    bridge.idle(now += 10'000'000);
    return bridge.outcome(ticket).code;
  };
  EXPECT_EQ(code("start"), OutcomeCode::Disconnected);
  EXPECT_EQ(code("stop"), OutcomeCode::Disconnected);
  EXPECT_EQ(code("joint_impedance"), OutcomeCode::Done);  // the mode of the next start
  EXPECT_EQ(code("hold"), OutcomeCode::Done);
  EXPECT_EQ(code("joint_impedance"), OutcomeCode::Held);
}

TEST(Requests, AnOutcomeTellsWhatWasSeen) {
  Cell cell;
  cell.robot.quality = fri::Quality::Ok;
  cell.start();
  const std::uint32_t ticket = cell.bridge.submit("joint_impedance");
  cell.run(1);
  const Outcome o = cell.bridge.outcome(ticket);
  EXPECT_EQ(o.ticket, ticket);
  EXPECT_EQ(o.kind, EventKind::Mode);
  EXPECT_EQ(o.code, OutcomeCode::InCommandMode);
  EXPECT_EQ(o.wanted, fri::ControlStrategy::JointImpedance);
  EXPECT_EQ(o.reported, fri::ControlStrategy::Position);
  EXPECT_EQ(o.state, fri::FriState::Command);
  EXPECT_EQ(o.quality, fri::Quality::Ok);
  EXPECT_EQ(o.convention, fri::KrlConvention::Coglab);
  EXPECT_EQ(runEvent(cell.bridge, cell.robot, "hold").wanted, fri::ControlStrategy::Position);
  EXPECT_EQ(cell.bridge.outcome(ticket).code, OutcomeCode::Pending);  // it was fetched
}

TEST(Requests, TicketsCountFromOneAndSixtyFourOutcomesAreKept) {
  Bridge bridge(defaultConfig());
  std::int64_t now = 1'000'000'000;
  for (std::uint32_t i = 1; i <= 66; ++i) {
    EXPECT_EQ(bridge.submit("hold"), i);
    bridge.idle(now += 10'000'000);
  }
  EXPECT_EQ(bridge.outcome(1).code, OutcomeCode::Pending);
  EXPECT_EQ(bridge.outcome(2).code, OutcomeCode::Pending);
  EXPECT_EQ(bridge.outcome(2).ticket, 2U);
  EXPECT_EQ(bridge.outcome(3).code, OutcomeCode::Done);
  EXPECT_EQ(bridge.outcome(66).code, OutcomeCode::Done);
  EXPECT_EQ(bridge.outcome(99).ticket, 99U);
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

/// The arm has three seconds to come to rest, then monitor mode is asked for all the same.
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

TEST(Requests, AStopOfAnArmAtRestAsksAtOnce) {
  Cell cell;
  cell.start();
  cell.run(20);
  cell.bridge.submit("stop");
  cell.run(1);
  EXPECT_EQ(cell.robot.answer.krl.ints[0], 2);
}

/// An idle tick may come at any time, also right after the first datagram.
TEST(Requests, AnIdleTickAfterTheFirstDatagramGoesOnWithAStart) {
  Cell cell;
  cell.robot.obeys = false;
  const std::uint32_t ticket = cell.bridge.submit("start");
  cell.run(1);
  cell.bridge.idle(cell.robot.now());
  EXPECT_EQ(cell.bridge.outcome(ticket).code, OutcomeCode::Pending);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Starting);
}

TEST(Requests, AnIdleTickInCommandModeEndsNothing) {
  Cell cell;
  cell.start();
  cell.bridge.idle(cell.robot.now() + 10'000'000);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
  EXPECT_EQ(cell.bridge.snapshot().fall_backs, 0U);
  cell.runDriven(60, Vector7::Constant(0.2));
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.2, 1e-9);
}

/// Silence counts from the last datagram: 0.25 s, or five cycles where they are longer.
TEST(Requests, SilenceIsToldAfterItsTimeLimit) {
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

}  // namespace
}  // namespace lwr_fri_bridge
