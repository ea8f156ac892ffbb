/// What a bridge sees of losses before and after command mode: their count, their length, the rest
/// before them, and whose set-point counts meanwhile.
#include <gtest/gtest.h>

#include <cmath>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::drive;

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

TEST(BridgeLosses, TheFirstDatagramIsNoLoss) {
  Cell cell;
  cell.robot.state = fri::FriState::Command;
  cell.run(1);
  cell.bridge.submit("start");
  cell.run(2);
  for (int i = 0; i < 2; ++i) cell.robot.cycle(cell.bridge, false, true);
  cell.robot.state = fri::FriState::Monitor;
  cell.run(1);
  EXPECT_EQ(cell.bridge.snapshot().loss.cause, LossCause::LeftByController);
}

TEST(BridgeLosses, SilenceIsToldWithItsLength) {
  for (const bool here : {false, true}) {
    Cell cell;
    cell.bridge.setControllerHere(here);
    cell.start();
    cell.run(20);
    const std::int64_t last = cell.robot.now();
    for (int i = 1; i <= 40; ++i) cell.bridge.idle(last + i * 10'000'000);
    const CommandModeLoss loss = cell.bridge.snapshot().loss;
    EXPECT_EQ(loss.cause, here ? LossCause::ControllerStalled : LossCause::ControllerSilent);
    EXPECT_NEAR(loss.seconds, 0.26, 1e-6);  // the first idle tick beyond 0.25 s
    EXPECT_FALSE(loss.at_rest);             // 0.1 s of standing do not make a rest
    EXPECT_TRUE(loss.position.isApprox(cell.robot.measured(), 1e-6));
    EXPECT_FLOAT_EQ(loss.timestamp, static_cast<float>(1e-9 * static_cast<double>(last)) - 0.005F);
  }
}

/// Time at rest goes on in the cycles whose measurements are lost.
TEST(BridgeLosses, RestCountsTheLostCycles) {
  for (const int pairs : {40, 60}) {
    Cell cell;
    cell.start();
    for (int i = 0; i < pairs; ++i) {
      cell.robot.cycle(cell.bridge, true);
      cell.run(1);
    }
    cell.robot.state = fri::FriState::Monitor;
    cell.run(1);
    EXPECT_EQ(cell.bridge.snapshot().loss.at_rest, pairs == 60) << pairs;  // 0.4 and 0.6 s
  }
}

/// The controller's own command moves while it is not commanded: every answer is its set-point.
TEST(BridgeLosses, TheSetPointOfAControllerThatIsNotCommandedIsMirrored) {
  for (const bool monitor : {true, false}) {
    Cell cell;
    if (!monitor) {
      cell.robot.state = fri::FriState::Command;
      cell.robot.power = 0x7E;
    }
    cell.run(3);
    for (int i = 0; i < 20; ++i) {
      cell.robot.moveOwn(cell.robot.own() + Vector7::Constant(0.002));
      const Vector7 set_point = cell.robot.setPoint();
      cell.run(1);
      for (int j = 0; j < 7; ++j) {
        ASSERT_FLOAT_EQ(cell.robot.answer.joint_position[j], static_cast<float>(set_point[j]))
            << monitor << " " << i;
      }
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

TEST(BridgeLosses, ATargetJustAboveTheSpeedLimitIsScaledAsAWhole) {
  Cell cell;
  const double limit = cell.bridge.config().limits.velocity[2];
  cell.start();
  Vector7 velocity = Vector7::Constant(0.5);
  velocity[2] = 1.25 * limit;
  cell.runDriven(100, velocity);
  const Vector7 v = cell.bridge.snapshot().sample.commanded_velocity;
  EXPECT_NEAR(v[2], limit, 1e-9);
  EXPECT_NEAR(v[0], 0.4, 1e-9);
}

}  // namespace
}  // namespace lwr_fri_bridge
