/// Implausible datagrams; power, quality and drive errors; observed losses.
#include <gtest/gtest.h>

#include <cmath>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::drive;
using test::runEvent;

/// One cycle with a modified measurement. Returns true if it was answered.
template <typename Change>
bool cycleWith(Cell& cell, Change change) {
  fri::MeasurementDatagram m = cell.robot.measure();
  change(m);
  std::uint8_t bytes[fri::kMeasurementSize];
  fri::encode(m, bytes);
  fri::CommandDatagram answer{};
  const bool answered = cell.bridge.answer(bytes, sizeof bytes, cell.robot.now(), answer);
  cell.robot.take(answered ? &answer : nullptr);
  return answered;
}

/// A joint cannot have moved by 0.3 rad within a cycle: refused and counted, no velocity is
/// reported that the arm cannot have, and the motion goes on.
TEST(BridgeFaults, AMeasuredPositionTheArmCannotHaveReachedIsRefused) {
  for (const double period : {0.001, 0.005, 0.020}) {
    Cell cell(period);
    cell.start();
    const Vector7 velocity = Vector7::Constant(0.3);
    cell.runDriven(static_cast<int>(0.5 / period), velocity);
    const std::uint64_t refused = cell.bridge.snapshot().session.implausible;
    EXPECT_FALSE(cycleWith(cell, [](auto& m) { m.measured_position[1] -= 0.3F; }));
    const double before = cell.robot.setPoint()[1];
    cell.runDriven(static_cast<int>(0.5 / period), velocity);
    EXPECT_EQ(cell.bridge.snapshot().session.implausible, refused + 1);
    EXPECT_NEAR(cell.robot.setPoint()[1] - before, 0.15, 0.01);
    EXPECT_NEAR(cell.bridge.snapshot().sample.velocity[1], 0.3, 0.01);
    EXPECT_EQ(cell.bridge.snapshot().counters.leash_trips, 0U);
  }
}

/// The sent answers are known, so a set-point that cannot follow from them is false, also after a
/// loss.
TEST(BridgeFaults, ASetPointThatDoesNotFollowFromTheAnswersIsRefused) {
  for (const bool after_a_loss : {false, true}) {
    for (const float shift : {0.02F, -0.02F, 0.002F, -0.002F}) {
      Cell cell(0.001);
      cell.start();
      const Vector7 velocity = Vector7::Constant(0.3);
      cell.runDriven(300, velocity);
      drive(cell.bridge, cell.robot, velocity);
      cell.robot.cycle(cell.bridge, false, after_a_loss);
      const std::uint64_t refused = cell.bridge.snapshot().session.implausible;
      Vector7 last = cell.robot.setPoint();
      EXPECT_FALSE(cycleWith(cell, [&](auto& m) { m.commanded_position_offset[2] += shift; }));
      for (int i = 0; i < 100; ++i) {
        cell.runDriven(1, velocity);
        const Vector7 step = cell.robot.setPoint() - last;
        ASSERT_LE(step.cwiseAbs().maxCoeff(), 2.0 * 0.3 * 0.001 + 1e-6) << shift << " " << i;
        last = cell.robot.setPoint();
      }
      EXPECT_EQ(cell.bridge.snapshot().session.implausible, refused + 1);
      EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
    }
  }
}

TEST(BridgeFaults, HigherBitsOfPowerAreNotDrives) {
  Cell cell;
  cell.robot.power = 0xFF7F;
  cell.start();
  cell.runDriven(60, Vector7::Constant(0.4));
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.4, 1e-9);
  cell.robot.power = 0xFF3F;
  cell.run(1);
  EXPECT_EQ(cell.bridge.snapshot().sample.block, MotionBlock::NoPower);
}

/// Quality UNACCEPTABLE or a drive error with full power: the arm brakes. The reason and the remedy
/// stay, also after the cause has ended, until a start.
TEST(BridgeFaults, PoorQualityAndDriveErrorsStopTheMotion) {
  for (const MotionBlock expected : {MotionBlock::PoorQuality, MotionBlock::DriveError}) {
    Cell cell;
    cell.start();
    cell.runDriven(60, Vector7::Constant(0.4));
    const std::uint32_t epoch = cell.bridge.snapshot().sample.motion_epoch;
    const bool quality = expected == MotionBlock::PoorQuality;
    const auto worsen = [&](fri::MeasurementDatagram& m) {
      if (quality) m.quality = static_cast<std::uint16_t>(fri::Quality::Unacceptable);
      if (!quality) m.drive_error = 0x04;
    };
    double last = 0.4;
    for (int i = 0; i < 40; ++i) {
      drive(cell.bridge, cell.robot, Vector7::Constant(0.4));
      EXPECT_TRUE(cycleWith(cell, worsen));
      const double now = cell.bridge.snapshot().sample.commanded_velocity[0];
      EXPECT_LE(std::abs(now - last), 10.0 * 0.005 + 1e-9);
      EXPECT_EQ(cell.bridge.snapshot().sample.block, expected);
      last = now;
    }
    EXPECT_EQ(last, 0.0);
    EXPECT_NE(cell.bridge.snapshot().sample.motion_epoch, epoch);
    EXPECT_EQ(cell.bridge.snapshot().fall_backs, 1U);
    cell.runDriven(40, Vector7::Constant(0.4));  // the cause has gone
    EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
    EXPECT_EQ(cell.bridge.snapshot().sample.block, expected);
    EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopped);
    EXPECT_TRUE(runEvent(cell.bridge, cell.robot, nextEvent(expected)).success());
    cell.run(2);
    cell.runDriven(60, Vector7::Constant(0.4));
    EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.4, 1e-9);
  }
}

/// Hold and reset that arrive together: the running motion ends, and the arm comes to rest.
TEST(BridgeFaults, AHoldBrakesEvenIfItIsResetAtOnce) {
  Cell cell;
  cell.start();
  cell.runDriven(60, Vector7::Constant(0.5));
  RobotSample old;
  cell.bridge.mailboxes().newestSample(old);
  const std::uint32_t hold = cell.bridge.submit("hold"), reset = cell.bridge.submit("reset");
  bool stood = false;
  for (int i = 0; i < 60; ++i) {
    // What runs does not look at the permission.
    cell.bridge.mailboxes().sendVelocity(
        {Vector7::Constant(0.5), cell.robot.now(), old.motion_epoch});
    cell.run(1);
    stood = stood || cell.bridge.snapshot().sample.commanded_velocity.isZero();
  }
  EXPECT_TRUE(cell.bridge.outcome(hold).success());
  EXPECT_TRUE(cell.bridge.outcome(reset).success());
  EXPECT_TRUE(stood);
  EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);  // released
  cell.runDriven(60, Vector7::Constant(0.5));
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity[0], 0.5, 1e-9);
}

/// Three in one gap, or a fourth where they fade one after the other.
TEST(BridgeLosses, SeveralPacketsLostShortlyBeforeAreTheCause) {
  for (const bool measurements : {false, true}) {
    for (const int lost : {2, measurements ? 3 : 4}) {
      Cell cell;
      cell.start();
      cell.run(20);
      for (int i = 0; i < lost; ++i) cell.robot.cycle(cell.bridge, measurements, !measurements);
      // The last answer before the end arrives: what is counted is what was lost before.
      cell.robot.state = fri::FriState::Monitor;
      cell.run(1);
      EXPECT_EQ(cell.bridge.snapshot().loss.cause,
                lost < 3 ? LossCause::LeftByController : LossCause::PacketsLost)
          << measurements << " " << lost;
    }
  }
}

/// Command mode begins at the frame that is reported, not at the one that the joints would have.
TEST(BridgeLosses, TheFirstCartesianAnswersAreTheReportedFrame) {
  Cell cell;
  cell.run(3);
  ASSERT_TRUE(runEvent(cell.bridge, cell.robot, "cartesian_impedance").success());
  cell.start();
  const float reported[12] = {1, 0, 0, 0.6F, 0, 1, 0, 0, 0, 0, 1, 0};
  for (int i = 0; i < 3; ++i) {
    cell.run(1);
    for (int j = 0; j < 12; ++j)
      EXPECT_NEAR(cell.robot.answer.cartesian_frame[j], reported[j], 1e-6) << i << " " << j;
  }
}

}  // namespace
}  // namespace lwr_fri_bridge
