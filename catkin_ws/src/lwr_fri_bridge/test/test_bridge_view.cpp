/// What the bridge shows of a tick to other threads, and which changes of it are told.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::drive;

TEST(BridgeView, EveryFieldOfAStateIsAChange) {
  const std::vector<std::function<void(StateView&)>> changes = {
      [](StateView& v) { v.supervisor = SupervisorState::Command; },
      [](StateView& v) { v.block = MotionBlock::Held; },
      [](StateView& v) { v.hold_latched = true; },
      [](StateView& v) { v.blocking_joint = 3; },
      [](StateView& v) { v.motion_epoch = 4; },
      [](StateView& v) { v.loss.cause = LossCause::PowerLost; },
      [](StateView& v) { v.state = fri::FriState::Command; },
      [](StateView& v) { v.quality = fri::Quality::Ok; },
      [](StateView& v) { v.control = fri::ControlStrategy::Position; },
      [](StateView& v) { v.power = 1; },
      [](StateView& v) { v.drive_error = 1; },
      [](StateView& v) { v.drive_warning = 1; },
      [](StateView& v) { v.cycle_time = 0.005; }};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    StateView one, other;
    EXPECT_TRUE(one == other);
    changes[i](other);
    EXPECT_FALSE(one == other) << i;
    changes[i](one);
    EXPECT_TRUE(one == other) << i;
  }
}

std::vector<StateView> toldBy(Bridge& bridge) {
  std::vector<StateView> told;
  for (StateView view; bridge.nextStateChange(view);) told.push_back(view);
  return told;
}

TEST(BridgeView, StatesAreToldOnceEachFromTheBeginningOn) {
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

TEST(BridgeView, ABridgeThatHasSeenNothingShowsNothing) {
  Bridge bridge(defaultConfig());
  const Snapshot s = bridge.snapshot();
  EXPECT_EQ(s.sample.sequence, 0U);
  EXPECT_EQ(s.sample.block, MotionBlock::Disconnected);
  EXPECT_EQ(s.sample.blocking_joint, -1);
  EXPECT_EQ(s.permission_since_ns, 0);
  EXPECT_EQ(s.bounded_joints, 0U);
  EXPECT_EQ(s.counters.requests_dropped, 0U);
  EXPECT_FALSE(s.request_busy);
  EXPECT_FALSE(bridge.connected());
  EXPECT_EQ(bridge.cycleTime(), 0.0);
  EXPECT_GT(s.sample.stop_rounding, 0.0);  // known before the first datagram
  EXPECT_DOUBLE_EQ(s.sample.stop_rounding, 2.0 * coglab_rt::kWireRounding);
}

TEST(BridgeView, ASnapshotShowsTheDatagram) {
  Cell cell;
  fri::MeasurementDatagram m = cell.robot.measure();
  m.answer_rate = 0.5F;
  m.latency = 0.0021F;
  m.jitter = 0.0003F;
  m.miss_rate = 0.25F;
  m.miss_counter = 77;
  m.safety_scale = 0.6F;
  m.timestamp = 123.5F;
  m.power = 0x3F;
  m.drive_error = 0x02;
  m.drive_warning = 0x04;
  for (int i = 0; i < 7; ++i) m.temperature[i] = 30.0F + static_cast<float>(i);
  std::uint8_t bytes[fri::kMeasurementSize];
  fri::encode(m, bytes);
  fri::CommandDatagram answer;
  ASSERT_TRUE(cell.bridge.answer(bytes, sizeof bytes, 777, answer));
  const Snapshot s = cell.bridge.snapshot();
  EXPECT_EQ(s.answer_rate, 0.5F);
  EXPECT_EQ(s.latency, 0.0021F);
  EXPECT_EQ(s.jitter, 0.0003F);
  EXPECT_EQ(s.miss_rate, 0.25F);
  EXPECT_EQ(s.miss_counter, 77U);
  EXPECT_EQ(s.safety_scale, 0.6F);
  EXPECT_EQ(s.timestamp, 123.5F);
  EXPECT_EQ(s.power, 0x3F);
  EXPECT_EQ(s.drive_error, 0x02);
  EXPECT_EQ(s.drive_warning, 0x04);
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(s.temperature[i], 30.0F + static_cast<float>(i));
  EXPECT_EQ(s.sample.sequence, 1U);
  EXPECT_EQ(s.sample.stamp_ns, 777);
  EXPECT_EQ(s.sample.controller_ns, 5'000'000);  // one cycle
  EXPECT_DOUBLE_EQ(s.sample.stop_delay, coglab_rt::lostTime(0.005));
  EXPECT_TRUE(s.sample.velocity.isZero());
  EXPECT_TRUE(s.sample.commanded_position.isApprox(cell.robot.setPoint(), 1e-6));
}

/// When the present epoch began, by the bridge's clock.
TEST(BridgeView, APermissionIsDatedFromItsBeginning) {
  Cell cell;
  cell.start();
  const std::int64_t since = cell.bridge.snapshot().permission_since_ns;
  EXPECT_GT(since, 1'000'000'000);
  cell.run(50);
  EXPECT_EQ(cell.bridge.snapshot().permission_since_ns, since);
  cell.bridge.submit("hold");
  cell.run(1);
  const std::int64_t held = cell.robot.now();
  EXPECT_EQ(cell.bridge.snapshot().permission_since_ns, held);
  cell.run(50);
  EXPECT_EQ(cell.bridge.snapshot().permission_since_ns, held);
}

TEST(BridgeView, WithoutALossNothingIsCounted) {
  Cell cell;
  cell.start();
  cell.runDriven(200, Vector7::Constant(0.2));
  const Snapshot s = cell.bridge.snapshot();
  EXPECT_EQ(s.counters.resumed_after_gap, 0U);
  EXPECT_EQ(s.counters.commands_invalid, 0U);
  EXPECT_EQ(s.counters.position_bounds, 0U);
  EXPECT_EQ(s.counters.leash_trips, 0U);
  EXPECT_EQ(s.counters.command_timeouts, 0U);
  EXPECT_EQ(s.bounded_joints, 0U);
  EXPECT_EQ(s.fall_backs, 0U);
  EXPECT_EQ(s.session.lost_answers, 0U);
  EXPECT_EQ(s.session.lost_measurements, 0U);
  EXPECT_EQ(s.session.rejected(), 0U);
  EXPECT_EQ(s.loss.cause, LossCause::None);
  cell.robot.cycle(cell.bridge, false, true);
  cell.runDriven(20, Vector7::Constant(0.2));
  EXPECT_EQ(cell.bridge.snapshot().counters.resumed_after_gap, 1U);
}

TEST(BridgeView, TheLeashOfTheFirstJointCountsAsAnyOther) {
  Cell cell;
  cell.start();
  Vector7 velocity = Vector7::Zero();
  velocity[0] = 0.3;
  cell.runDriven(50, velocity);
  cell.robot.blocked = true;
  cell.runDriven(200, velocity);
  const Snapshot s = cell.bridge.snapshot();
  EXPECT_EQ(s.counters.leash_trips, 1U);
  EXPECT_EQ(s.sample.block, MotionBlock::Leashed);
  EXPECT_EQ(s.sample.blocking_joint, 0);
}

TEST(BridgeView, JointsBoundedByTheirStopsAreNamedByBits) {
  Cell cell;
  cell.start();
  Vector7 velocity = Vector7::Zero();
  velocity[5] = 1.0;
  cell.runDriven(600, velocity);
  EXPECT_EQ(cell.bridge.snapshot().bounded_joints, 1U << 5);
  cell.run(30);  // the command has ended, and the joint stands at its bound
  cell.bridge.submit("stop");
  cell.run(50);
  EXPECT_EQ(cell.bridge.snapshot().bounded_joints, 0U);
}

/// A bridge that meets a controller in command mode speaks its strategy, for the flags may not
/// change there.
TEST(BridgeView, TheFlagsOfACommandModeThatWasFoundAreItsStrategys) {
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
TEST(BridgeView, ACommandOfTheFutureOrOfLongPeriodsCountsWithinItsLimit) {
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

TEST(BridgeView, AZeroVelocityThatEndsIsNoTimeout) {
  Cell cell;
  cell.start();
  cell.runDriven(20, Vector7::Zero());
  cell.run(40);
  EXPECT_EQ(cell.bridge.snapshot().counters.command_timeouts, 0U);
  cell.runDriven(20, Vector7::Constant(0.1));
  cell.run(40);
  cell.runDriven(20, Vector7::Constant(0.1));
  cell.run(40);
  EXPECT_EQ(cell.bridge.snapshot().counters.command_timeouts, 2U);
}

/// Quality and drive errors leave command mode in force: no cause of a loss is told for them.
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
