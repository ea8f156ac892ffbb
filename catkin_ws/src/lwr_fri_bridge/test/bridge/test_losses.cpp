/// Limits and braking distance with losses, over loss, period, pattern and kind of controller.
#include <gtest/gtest.h>

#include <cstdlib>

#include "bridge_cell.hpp"
#include "loss_campaign.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::drive;
using test::LossRun;
using test::runEvent;

/// A sample of the campaign that bench/loss_campaign.cpp runs in whole; with COGLAB_LONG more of
/// it.
TEST(Losses, NoSetPointLeavesItsBoundsUnderAnyLoss) {
  const unsigned seeds = std::getenv("COGLAB_LONG") != nullptr ? 200 : 2;
  for (const double period : {0.001, 0.002, 0.005, 0.010, 0.020}) {
    for (const double share : {0.0, 0.01, 0.05, 0.10}) {
      for (const bool bursts : {false, true}) {
        for (const bool extrapolates : {true, false}) {
          for (unsigned seed = 0; seed < 2 * seeds; ++seed) {
            LossRun run({period, share, bursts, extrapolates, seed / 2, seed % 2 != 0});
            ASSERT_TRUE(run.started());
            const test::SetPointExtremes worst = run.approach();
            const auto where = [&] {
              return ::testing::Message()
                     << period << " s, " << share << (bursts ? " in bursts" : "") << ", "
                     << (extrapolates ? "extrapolates" : "stands") << ", seed " << seed;
            };
            EXPECT_LE(worst.beyond, 0.0) << where();
            EXPECT_LE(worst.speed, 0.0) << where();
            EXPECT_LE(worst.acceleration, 1e-6) << where();
            EXPECT_TRUE(run.commanding()) << where();
          }
        }
      }
    }
  }
}

/// The worst that the budget allows, beginning at each cycle of an approach at full speed on a
/// connection that had lost nothing: 5 cycles, an answer, 5 cycles, ... 20 in all. The bounds hold,
/// and at long periods, where losses decide, the set-point comes close to them.
TEST(Losses, TheWorstPatternOfTheBudgetKeepsTheBounds) {
  for (const double period : {0.001, 0.002, 0.005, 0.010, 0.020}) {
    double closest = -1e9;
    const int step = std::max(1, static_cast<int>(0.02 / period));
    for (int begin = 0; begin < static_cast<int>(1.2 / period); begin += step) {
      LossRun run({period, 0.0, false, true, 1, true});
      ASSERT_TRUE(run.started());
      const test::SetPointExtremes worst = run.approachLosing(begin);
      EXPECT_LE(worst.beyond, 0.0) << period << " s, losses from cycle " << begin << " on";
      EXPECT_LE(worst.speed, 0.0) << period;
      EXPECT_LE(worst.acceleration, 1e-6) << period;
      closest = std::max(closest, worst.beyond);
    }
    EXPECT_GT(closest, -2e-3) << period;
  }
}

/// Braking continues from the last answer that the controller received. Losses add only their own
/// displacement.
TEST(Losses, BrakingDoesNotRestartAfterALoss) {
  for (const double period : {0.001, 0.005, 0.020}) {
    double angle[2];
    int lost = 0;
    for (const bool lossy : {false, true}) {
      Cell cell(period);
      cell.robot.moveOwn(Vector7::Constant(-1.0));
      cell.robot.setMeasured(Vector7::Constant(-1.0));
      cell.start();
      const double speed = 1.5;
      cell.runDriven(static_cast<int>(0.5 / period), Vector7::Constant(speed));
      const double from = cell.robot.setPoint()[0];
      cell.bridge.submit("hold");
      cell.run(1);
      for (int i = 0; i < static_cast<int>(1.0 / period); ++i) {
        const bool lose = lossy && i % 7 == 3;
        const bool moves = !cell.bridge.snapshot().sample.commanded_velocity.isZero();
        lost += lose && moves ? 1 : 0;
        cell.robot.cycle(cell.bridge, lose && i % 2 == 0, lose && i % 2 != 0);
      }
      angle[lossy ? 1 : 0] = cell.robot.setPoint()[0] - from;
      EXPECT_TRUE(cell.bridge.snapshot().sample.commanded_velocity.isZero());
    }
    EXPECT_GT(lost, 0);
    EXPECT_LE(angle[1], angle[0] + 0.75 * lost * 1.5 * period) << period;
    EXPECT_GE(angle[1], angle[0]) << period;
  }
}

/// If the controller stood, the set-point starts from rest; if it continued, at its speed.
TEST(Losses, AfterAGapTheSetPointContinuesThatOfTheController) {
  for (const bool extrapolates : {true, false}) {
    for (const int gap : {1, 2, 5}) {
      for (const bool measurements : {false, true}) {
        Cell cell(0.005);
        cell.robot.extrapolates = extrapolates;
        cell.start();
        const Vector7 velocity = Vector7::Constant(0.3);
        cell.runDriven(80, velocity);
        for (int i = 0; i < gap; ++i) {
          drive(cell.bridge, cell.robot, velocity);
          cell.robot.cycle(cell.bridge, measurements, !measurements);
        }
        const Vector7 before = cell.robot.setPoint();
        cell.runDriven(1, velocity);
        const Vector7 step = cell.robot.setPoint() - before;
        const double expected = extrapolates ? 0.3 * 0.005 : 500.0 * std::pow(0.005, 3) / 6.0;
        for (int j = 0; j < 7; ++j) EXPECT_NEAR(step[j], expected, 2e-6) << gap << " " << j;
        EXPECT_GT(cell.bridge.snapshot().counters.resumed_after_gap, 0U);
        EXPECT_EQ(cell.bridge.snapshot().session.implausible, 0U);
      }
    }
  }
}

/// In Cartesian impedance mode only the frame shows the controller's set-point, because the
/// reported joint set-point is that of the arm. Joint 1 turns about the vertical, so its angle
/// equals that of the frame. Losses must not accumulate a difference between them.
TEST(Losses, TheCartesianSetPointDoesNotDriftFromTheFrame) {
  Cell cell(0.005);
  cell.run(3);
  ASSERT_TRUE(runEvent(cell.bridge, cell.robot, "cartesian_impedance").success());
  cell.start();
  const double begin = cell.bridge.snapshot().sample.commanded_position[0];
  Vector7 velocity = Vector7::Zero();
  for (int i = 0; i < 600; ++i) {
    velocity[0] = 0.6;
    drive(cell.bridge, cell.robot, velocity);
    cell.robot.cycle(cell.bridge, i % 20 == 4, i % 20 == 15);
  }
  cell.runDriven(1, velocity);
  const float* frame = cell.robot.answer.cartesian_frame;
  const double turned = std::atan2(frame[4], frame[0]);
  const double commanded = cell.bridge.snapshot().sample.commanded_position[0] - begin;
  EXPECT_GT(turned, 0.1);
  EXPECT_NEAR(commanded, turned, 1e-3);
}

/// If the controller moved the frame by itself in a gap, the next answer continues from there and
/// does not jump back to the path of earlier answers. The same holds if only answers were lost.
TEST(Losses, AfterAGapTheCartesianFrameContinuesTheReportedOne) {
  for (const int gap : {1, 3, 5}) {
    for (const char* const lost : {"measurements", "answers", "either in turn"}) {
      Cell cell(0.005);
      cell.run(3);
      ASSERT_TRUE(runEvent(cell.bridge, cell.robot, "cartesian_impedance").success());
      cell.start();
      Vector7 velocity = Vector7::Zero();
      velocity[0] = 0.05;
      cell.runDriven(100, velocity);
      const float before = cell.robot.answer.cartesian_frame[3];
      for (int i = 0; i < gap; ++i) {
        drive(cell.bridge, cell.robot, velocity);
        const bool measurement = lost[0] == 'm' || (lost[0] == 'e' && i % 2 == 0);
        cell.robot.cycle(cell.bridge, measurement, !measurement);
      }
      cell.robot.moveFrame(0.005);
      cell.runDriven(1, velocity);
      EXPECT_NEAR(cell.robot.answer.cartesian_frame[3], before + 0.005F, 1e-3F) << gap << lost;
      cell.runDriven(20, velocity);
      EXPECT_NEAR(cell.robot.answer.cartesian_frame[3], before + 0.005F, 1e-3F) << gap << lost;
    }
  }
}

/// The controller's counter restarts at full speed: the set-point brakes from the last answer.
TEST(Losses, ARestartedCounterBrakesFromTheLastAnswer) {
  for (const double period : {0.005, 0.020}) {
    Cell cell(period);
    cell.robot.moveOwn(Vector7::Constant(-1.0));
    cell.robot.setMeasured(Vector7::Constant(-1.0));
    cell.start();
    cell.runDriven(static_cast<int>(0.6 / period), Vector7::Constant(1.5));
    cell.robot.setCounter(40000);
    Vector7 last = cell.robot.setPoint(), last_v = Vector7::Constant(1.5);
    for (int i = 0; i < static_cast<int>(0.8 / period); ++i) {
      drive(cell.bridge, cell.robot, Vector7::Constant(1.5));
      cell.robot.cycle(cell.bridge);
      const Vector7 v = (cell.robot.setPoint() - last) / period;
      EXPECT_LE((v - last_v).cwiseAbs().maxCoeff(), 10.0 * period + 1e-3) << period << " " << i;
      last = cell.robot.setPoint();
      last_v = v;
    }
    EXPECT_LT(last_v.cwiseAbs().maxCoeff(), 1e-3);
    EXPECT_EQ(cell.bridge.snapshot().session.restarts, 1U);
    EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Stopped);
  }
}

/// The controller's time continues while measurements are lost.
TEST(Losses, TimeCountsTheLostCycles) {
  Cell cell(0.005);
  cell.start();
  const std::int64_t before = cell.bridge.snapshot().sample.controller_ns;
  const std::uint64_t sequence = cell.bridge.snapshot().sample.sequence;
  for (int i = 0; i < 300; ++i) cell.robot.cycle(cell.bridge, i % 3 == 1, i % 3 == 2);
  EXPECT_EQ(cell.bridge.snapshot().sample.sequence - sequence, 200U);
  EXPECT_EQ(cell.bridge.snapshot().sample.controller_ns - before, 1'500'000'000);
}

}  // namespace
}  // namespace lwr_fri_bridge
