/// What the bridge commands, cycle by cycle: limits on the wire, losses, FRI periods, position
/// limits, the wrench.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "bridge_cell.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;
using test::defaultConfig;
using test::drive;
using test::runEvent;
using test::SmallController;

/// Single losses: the set-point goes on without a leap and within speed and acceleration limits, as
/// the controller sees it.
TEST(Bridge, RidesThroughLossesWithoutALeap) {
  for (const double period : {0.001, 0.005, 0.010}) {
    Cell cell(period);
    cell.start();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> part(0.0, 1.0);
    const JointLimits& limits = cell.bridge.config().limits;
    Vector7 last = cell.robot.setPoint(), last_velocity = Vector7::Zero(),
            velocity = Vector7::Zero();
    int losses = 0;
    for (int i = 0; i < static_cast<int>(8.0 / period); ++i) {
      if (i % static_cast<int>(0.4 / period) == 0)
        velocity = Vector7::Constant(0.6 * (i % 2 == 0 ? 1 : -1) * part(random));
      drive(cell.bridge, cell.robot, velocity);
      const double dice = part(random);
      cell.robot.cycle(cell.bridge, dice<0.05, dice> 0.95);
      losses += dice < 0.05 || dice > 0.95 ? 1 : 0;
      const Vector7 v = (cell.robot.setPoint() - last) / period;
      for (int j = 0; j < 7; ++j) {
        const double noise = 6e-7 / period;  // float32 on the wire, twice
        ASSERT_LE(std::abs(v[j]), limits.velocity[j] + noise);
        ASSERT_LE(std::abs(v[j] - last_velocity[j]), limits.acceleration[j] * period + 2.0 * noise)
            << i << " " << j;
      }
      last = cell.robot.setPoint();
      last_velocity = v;
    }
    const Snapshot s = cell.bridge.snapshot();
    EXPECT_EQ(s.supervisor, SupervisorState::Command);
    EXPECT_GT(losses, 50);
    EXPECT_GT(s.session.lost_measurements, 0U);
    EXPECT_GT(s.session.lost_answers, 0U);
    EXPECT_GT(s.counters.resumed_after_gap, 0U);
  }
}

TEST(Bridge, NoPositionLimitIsCrossedWhateverIsAsked) {
  for (const double period : {0.001, 0.005, 0.020}) {
    Cell cell(period);
    cell.start();
    const double way = period < 0.01 ? 1.5 : 3.0;  // s; 20 cycles may be lost, which takes its time
    std::mt19937 random(3);
    std::uniform_real_distribution<double> speed(-3.0, 3.0);
    Vector7 velocity = Vector7::Zero();
    Vector7 reached = Vector7::Zero();
    for (int i = 0; i < static_cast<int>(20.0 * way / period); ++i) {
      if (i % static_cast<int>(way / period) == 0) {
        for (int j = 0; j < 7; ++j) velocity[j] = speed(random);
      }
      drive(cell.bridge, cell.robot, velocity);
      cell.robot.cycle(cell.bridge);
      const Vector7 q = cell.robot.setPoint();
      reached = reached.cwiseMax(q.cwiseAbs());
      for (int j = 0; j < 7; ++j) {
        ASSERT_LE(q[j], cell.bridge.config().limits.upper_position[j]);
        ASSERT_GE(q[j], cell.bridge.config().limits.lower_position[j]);
      }
    }
    for (int j = 0; j < 7; ++j) {  // the range is not given away either
      EXPECT_GT(reached[j], cell.bridge.config().limits.upper_position[j] - 0.03) << j;
    }
    EXPECT_GT(cell.bridge.snapshot().counters.position_bounds, 0U);
  }
}

/// friOpen with another period: the counters go on, no velocity spike, and every bound holds at the
/// new period.
TEST(Bridge, FollowsAnotherPeriodAfterFriWasOpenedAgain) {
  Cell cell(0.001);
  const JointLimits& limits = cell.bridge.config().limits;
  std::uint64_t changes = 0;
  for (const double period : {0.001, 0.005, 0.1, 0.020, 0.002}) {
    if (period != cell.robot.period()) {
      cell.robot.state = fri::FriState::Monitor;
      cell.robot.setPeriod(period);
      // Between friClose and friOpen the KRL program may have moved the arm a little.
      cell.robot.moveOwn(cell.robot.own() + Vector7::Constant(0.01));
      cell.robot.setMeasured(cell.robot.setPoint());
      cell.run(1);
      ++changes;
      EXPECT_TRUE(cell.bridge.snapshot().sample.velocity.isZero()) << period;
      const Vector7 answered = fri::jointsFromWire(cell.robot.answer.joint_position);
      EXPECT_LT((answered - cell.robot.setPoint()).cwiseAbs().maxCoeff(), 2e-7) << period;
    }
    cell.start();
    EXPECT_DOUBLE_EQ(cell.bridge.snapshot().sample.cycle_time, period);
    Vector7 last = cell.robot.setPoint(), last_v = Vector7::Zero();
    const double begin = last[0];
    const int cycles = static_cast<int>(std::lround(1.2 / period));
    for (int i = 0; i < cycles; ++i) {
      drive(cell.bridge, cell.robot, Vector7::Constant(i < cycles * 3 / 4 ? 0.15 : 0.0));
      cell.robot.cycle(cell.bridge);
      const Vector7 v = (cell.robot.setPoint() - last) / period;
      for (int j = 0; j < 7; ++j) {
        const double noise = 6e-7 / period;  // float32 on the wire, twice
        ASSERT_LE(std::abs(v[j]), limits.velocity[j] + noise) << period;
        ASSERT_LE(std::abs(v[j] - last_v[j]), limits.acceleration[j] * period + 2.0 * noise)
            << period;
      }
      last = cell.robot.setPoint();
      last_v = v;
    }
    EXPECT_NEAR(last[0] - begin, 0.135, 0.03) << period;
    EXPECT_EQ(cell.bridge.snapshot().session.new_periods, changes);
    EXPECT_EQ(cell.bridge.snapshot().session.restarts, 0U);
    EXPECT_TRUE(runEvent(cell.bridge, cell.robot, "stop").success());
  }
}

/// The estimate comes in the base's axes about the tool, and is told in the tool's axes.
TEST(Bridge, WrenchIsToldInTheToolsAxes) {
  for (const bool filled : {true, false}) {
    SmallController robot(0.005);
    Vector7 posture;
    posture << 0.4, 0.7, -0.3, -1.1, 0.6, 0.9, -0.5;
    robot.moveOwn(posture);
    robot.setMeasured(posture);
    fri::MeasurementDatagram m = robot.measure();
    // A tool turned by 90 degrees about the flange's z; without a frame: the flange itself.
    Eigen::Matrix3d tool = flangePose(posture).linear();
    if (filled) {
      tool *= Eigen::AngleAxisd(M_PI / 2.0, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
          m.measured_frame[4 * row + column] = static_cast<float>(tool(row, column));
      }
    }
    const Eigen::Vector3d force(3.0, -5.0, 7.0), torque(0.2, 0.4, -0.6);
    Vector6 wrench;
    wrench << force, torque;
    fri::wrenchToWire(wrench, m.external_wrench);
    EXPECT_TRUE(toolWrench(m, false).head<3>().isApprox(tool.transpose() * force, 1e-5));
    EXPECT_TRUE(toolWrench(m, false).tail<3>().isApprox(tool.transpose() * torque, 1e-5));
    EXPECT_TRUE(toolWrench(m, true).isApprox(wrench, 1e-6));
  }
}

/// What a person sees on the wire: float32 positions, speed and acceleration by differences.
TEST(Bridge, TheWireKeepsTheLimitsAtEveryPeriod) {
  for (const double period : {0.001, 0.005, 0.020, 0.100}) {
    Cell cell(period);
    cell.start();
    const JointLimits& limits = cell.bridge.config().limits;
    std::mt19937 random(21);
    std::uniform_real_distribution<double> part(-1.5, 1.5);
    Vector7 velocity = Vector7::Zero(), last = cell.robot.setPoint(), last_v = Vector7::Zero();
    for (int i = 0; i < 6000; ++i) {
      if (i % 13 == 0) {
        for (int j = 0; j < 7; ++j) velocity[j] = part(random) * limits.velocity[j];
      }
      drive(cell.bridge, cell.robot, velocity);
      cell.robot.cycle(cell.bridge);
      const Vector7 sent = fri::jointsFromWire(cell.robot.answer.joint_position);
      const Vector7 v = (sent - last) / period;
      if (i > 1) {
        ASSERT_LE((v.cwiseAbs() - limits.velocity).maxCoeff(), 5e-4) << period << " " << i;
        ASSERT_LE(((v - last_v).cwiseAbs() / period - limits.acceleration).maxCoeff(), 1.0)
            << period << " " << i;
      }
      last = sent;
      last_v = v;
    }
    EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
  }
}

TEST(Bridge, EveryPeriodOfFriFollows) {
  for (const double period : {0.001, 0.002, 0.005, 0.010, 0.020, 0.050, 0.100}) {
    Cell cell(period);
    cell.start();
    const double before = cell.robot.setPoint()[0];
    cell.runDriven(static_cast<int>(2.0 / period), Vector7::Constant(0.3));
    EXPECT_NEAR(cell.robot.setPoint()[0] - before, 0.6, 0.06) << period;
    EXPECT_EQ(cell.bridge.snapshot().counters.command_timeouts, 0U) << period;
    EXPECT_EQ(cell.bridge.snapshot().counters.leash_trips, 0U) << period;
  }
}

TEST(Bridge, T1ProfileBoundsSpeed) {
  Cell cell(0.005, defaultConfig("t1"));
  cell.start();
  cell.runDriven(400, Vector7::Constant(1.0));
  // The measured arm keeps 0.24: commanded is less by what the servos pass it.
  EXPECT_NEAR(cell.bridge.snapshot().sample.commanded_velocity.maxCoeff(), 0.24 / 1.04, 1e-9);
}

}  // namespace
}  // namespace lwr_fri_bridge
