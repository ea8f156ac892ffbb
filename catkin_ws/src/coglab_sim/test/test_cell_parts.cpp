/// The small parts of the cell by themselves: what its structures begin with, random numbers,
/// geometry, statistics, ranges, sensors.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "coglab_sim/cell.hpp"
#include "coglab_sim/pace.hpp"
#include "coglab_sim/random.hpp"
#include "coglab_sim/ranges.hpp"
#include "coglab_sim/real_time_cell.hpp"

using namespace coglab_sim;

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

TEST(Pace, IsHalvedWhileTheComputerIsTooBusyAndComesBackCarefully) {
  ComputerLoad busy, calm;
  busy.late_steps = 0.6;
  calm.late_steps = 0.1;
  const auto secondsUntil = [](Pace& pace, const ComputerLoad& load, double factor) {
    int seconds = 0;
    while (pace.factor() != factor && seconds < 100) ++seconds, pace.update(load);
    return seconds;
  };
  Pace pace(1.0);
  EXPECT_LE(secondsUntil(pace, busy, 0.5), 3);
  EXPECT_LE(secondsUntil(pace, busy, 0.25), 3);
  for (int i = 0; i < 20; ++i) pace.update(busy);
  EXPECT_EQ(pace.factor(), 0.25) << "not slower than a quarter";
  EXPECT_TRUE(pace.busy());
  const int first = secondsUntil(pace, calm, 0.5);
  EXPECT_LE(secondsUntil(pace, busy, 0.25), 3);
  EXPECT_GT(secondsUntil(pace, calm, 0.5), first) << "more careful after it was too early";
  secondsUntil(pace, calm, 1.0);
  EXPECT_EQ(pace.factor(), 1.0);
  EXPECT_FALSE(pace.busy());

  Pace fast(2.0);
  for (int i = 0; i < 10; ++i) fast.update(busy);
  EXPECT_EQ(fast.factor(), 2.0);
}

}  // namespace

// -- what structures begin with
// --------------------------------------------------------------------

TEST(Begins, WhatMovesAtRestAndWhatIsHeldByNothing) {
  const CellTruth truth;
  EXPECT_EQ(truth.time, 0.0);
  EXPECT_EQ(truth.hand_closure, 0.0);
  EXPECT_EQ(truth.robot_load_share + truth.human_load_share, 0.0);
  EXPECT_EQ(truth.held_by, "");
  EXPECT_FALSE(truth.dropped);
  EXPECT_EQ((truth.palm_force + truth.touch_force + truth.human_force).norm(), 0.0);
  EXPECT_EQ(Twist{}.linear.norm() + Twist{}.angular.norm(), 0.0);
  EXPECT_EQ(Wrench{}.stacked().norm(), 0.0);
  EXPECT_EQ(Pose{}.position.norm(), 0.0);
  EXPECT_EQ(Pose{}.rotation.w(), 1.0);
  const TickRecord record;
  EXPECT_EQ(record.time + record.state + record.quality + record.power + record.control, 0.0);
  EXPECT_FALSE(record.answered);
  const CellSnapshot snapshot;
  EXPECT_EQ(snapshot.tick + snapshot.late_ticks + snapshot.answers, 0U);
  EXPECT_EQ(snapshot.refused_hand, "");
  EXPECT_EQ(krc::Message{}.time, 0.0);
  const krc::Rejections none;
  EXPECT_EQ(none.wrong_size + none.wrong_header + none.stale + none.repeated, 0U);
}

TEST(Begins, MotorsOffAndHandsOpen) {
  const plant::MotorCommand command;
  EXPECT_EQ(command.speed, 0.0);
  EXPECT_EQ(command.target, 0.0);
  EXPECT_EQ(command.current, 1000.0);
  const plant::MotorState state;
  EXPECT_EQ(state.position + state.tension + state.effort + state.current, 0.0);
  EXPECT_FALSE(state.moving || state.locked);
  const plant::PersonInput person;
  EXPECT_EQ(person.grip, 0.0);
  EXPECT_EQ(person.grip_force, 20.0);
  EXPECT_EQ(plant::Touch{}.palm.norm(), 0.0);
  EXPECT_TRUE(plant::Touch{}.phalanges.empty());
  const plant::FreeBody body;
  EXPECT_EQ(body.mass, 1.0);
  EXPECT_EQ(body.inertia, Vector3d::Ones());
  const plant::HoldFigures hold;
  EXPECT_EQ(hold.bandwidth, 60.0);
  EXPECT_EQ(hold.force, 40.0);
  EXPECT_EQ(hold.torque, 2.0);
}

TEST(Begins, ServosInPositionControlAtRest) {
  const krc::ServoCommand servo;
  EXPECT_EQ(servo.strategy, lwr_fri_bridge::fri::ControlStrategy::Position);
  for (const Vector7& zero :
       {servo.position, servo.velocity, servo.torque, servo.stiffness, servo.damping})
    EXPECT_EQ(zero, Vector7(Vector7::Zero()));
  for (const Vector6& zero : {servo.force, servo.frame_stiffness, servo.frame_damping})
    EXPECT_EQ(zero, Vector6(Vector6::Zero()));
  const ModelErrors exact;
  EXPECT_EQ(exact.payload, 1.0);
  for (const double share : exact.inertia) EXPECT_EQ(share, 1.0);
  EXPECT_EQ(plant::kStep, 1e-3);
  EXPECT_EQ(plant::kGravity, 9.81);
  EXPECT_EQ(plant::kPersonMass, 0.5);
  EXPECT_EQ(plant::kMotors, 5);
  EXPECT_EQ(plant::kFingers, 5);
}

TEST(Begins, TheCellAsItIsConfigured) {
  const CellConfig config;
  EXPECT_EQ(config.seed, 1U);
  EXPECT_EQ(config.object_start, "human_hand");
  EXPECT_EQ(config.object_pose.position, Vector3d(-0.08, 0.0, -0.05));
  EXPECT_EQ(config.krc.mode, krc::OperatingMode::Automatic);
  EXPECT_EQ(config.krc.convention, krc::KrlConvention::Coglab);
  EXPECT_TRUE(config.krc.acknowledge_by_program);
  const plant::PlantConfig plant;
  EXPECT_EQ(plant.seed, 1U);
  EXPECT_EQ(plant.home, Vector7(Vector7::Zero()));
  EXPECT_EQ(plant.person.reach, 0.06);
  EXPECT_EQ(plant.surroundings.floor_height, -0.75);
  const CellParameter row;
  EXPECT_EQ(row.low + row.high, 0.0);
  // A table of the hand that nobody has read is a hand that nobody can wind.
  const plant::HandTable table;
  EXPECT_EQ(table.sliding, 0.8);
  EXPECT_EQ(table.torsional, 0.004);
  EXPECT_EQ(table.rolling, 0.0001);
  EXPECT_EQ(table.joint_damping, 0.03);
  EXPECT_EQ(table.joint_armature, 2e-4);
  EXPECT_EQ(table.tendon_stiffness, 5e4);
  EXPECT_EQ(table.full_stroke, 1.0);
  EXPECT_EQ(table.lock_share, 0.05);
  EXPECT_EQ(table.lock_time, 0.2);
  EXPECT_EQ(table.free_current, 40.0);
  EXPECT_EQ(table.speed_current, 60.0);
  EXPECT_EQ(table.stall_current, 1000.0);
  EXPECT_EQ(table.phalangesMass(), 0.0);
  const plant::MotorRow motor;
  EXPECT_EQ(motor.limit + motor.stroke + motor.open_length, 0.0);
  EXPECT_FALSE(motor.both_ways);
  const plant::Phalanx p;
  EXPECT_EQ(p.motor, 0);
  EXPECT_FALSE(p.first);
  EXPECT_EQ(p.lower + p.upper + p.spring + p.arm + p.length + p.radius + p.mass, 0.0);
}

// -- numbers
// ---------------------------------------------------------------------------------------

/// The published reference: pcg32 with seed 42 and stream 54.
TEST(Random, IsThePublishedGenerator) {
  Random random(42, 54);
  for (const std::uint32_t expected :
       {0xa15c02b7U, 0x7b47f409U, 0xba1d3330U, 0x83d2f293U, 0xbfa4784bU, 0xcbed606eU})
    EXPECT_EQ(random.next(), expected);
  Random uniform(42, 54);
  EXPECT_DOUBLE_EQ(uniform.uniform(), 0xa15c02b7U / 4294967296.0);
  EXPECT_NE(Random(7).next(), Random(7, 1).next());
  Random plain(7), same(7, 0);
  EXPECT_EQ(plain.next(), same.next());
}

TEST(Random, NormalNumbersComeInPairsOfOneCircle) {
  Random uniform(3), random(3);
  for (int pair = 0; pair < 50; ++pair) {
    double u = 0.0, v = 0.0, square = 0.0;
    do {
      u = 2.0 * uniform.uniform() - 1.0;
      v = 2.0 * uniform.uniform() - 1.0;
      square = u * u + v * v;
    } while (square >= 1.0 || square == 0.0);
    const double scale = std::sqrt(-2.0 * std::log(square) / square);
    EXPECT_DOUBLE_EQ(random.normal(), u * scale);
    EXPECT_DOUBLE_EQ(random.normal(), v * scale);
  }
}

TEST(Geometry, PosesAndTwists) {
  const Pose turned{Vector3d(1, 2, 3), Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ()))};
  EXPECT_LT((turned * Vector3d(1, 0, 0) - Vector3d(1, 3, 3)).norm(), 1e-12);
  const Pose both = turned * Pose{Vector3d(0, 1, 0), turned.rotation};
  EXPECT_LT((both.position - Vector3d(0, 2, 3)).norm(), 1e-12);
  EXPECT_NEAR(std::abs(both.rotation.z()), 1.0, 1e-12);
  const Pose back = turned.inverse() * turned;
  EXPECT_LT(back.position.norm(), 1e-12);
  EXPECT_NEAR(std::abs(back.rotation.w()), 1.0, 1e-12);
  EXPECT_LT((turned.inverse() * Vector3d(1, 3, 3) - Vector3d(1, 0, 0)).norm(), 1e-12);
  const Twist twist{Vector3d(1, 0, 0), Vector3d(0, 0, 2)};
  EXPECT_EQ(twist.at(Vector3d(0, 3, 0)), Vector3d(-5, 0, 0));
  Wrench wrench;
  wrench.add(Vector3d(0, 1, 0), Vector3d(2, 0, 0));
  wrench.add(Vector3d(0, 1, 0), Vector3d(2, 0, 0));
  EXPECT_EQ(wrench.stacked(), (Vector6() << 0, 2, 0, 0, 0, 4).finished());
}

TEST(Geometry, TheShortWayFromOneRotationToAnother) {
  const Quaterniond none = Quaterniond::Identity();
  for (const double angle : {-3.1, -1.0, 0.0, 1e-7, 0.3, 3.1}) {
    const Vector3d axis = Vector3d(1, 2, -2) / 3.0;
    const Quaterniond turn(Eigen::AngleAxisd(angle, axis));
    EXPECT_LT((rotationBetween(none, turn) - angle * axis).norm(), 1e-9) << angle;
    Quaterniond same;
    same.coeffs() = -turn.coeffs();
    EXPECT_LT((rotationBetween(none, same) - angle * axis).norm(), 1e-9) << angle;
    EXPECT_LT((rotationBetween(turn, none) + angle * axis).norm(), 1e-9) << angle;
  }
  const Quaterniond long_way(Eigen::AngleAxisd(4.0, Vector3d::UnitX()));
  EXPECT_NEAR(rotationBetween(none, long_way).x(), 4.0 - 2.0 * M_PI, 1e-12);
  EXPECT_EQ(rotationBetween(none, none).norm(), 0.0);
}

TEST(Ranges, OfTheNodeAndOfFaults) {
  struct Expected {
    const char* name;
    double low, high;
  };
  for (const Expected& row : {Expected{"fri_port", 0, 65535},
                              {"fri_source_port", 0, 65535},
                              {"port_wait", 0, 3600},
                              {"rt_priority", 0, 98},
                              {"speed", 0.01, 100},
                              {"truth_rate", 1, 1000},
                              {"fault/lose_packets", 0, 1e6},
                              {"fault/packet_loss", 0, 1},
                              {"fault/silence", 0, 1e6},
                              {"nothing", 0, 0}}) {
    EXPECT_EQ(rangeOf(row.name).low, row.low) << row.name;
    EXPECT_EQ(rangeOf(row.name).high, row.high) << row.name;
  }
  EXPECT_NO_THROW(requireWithin("truth_rate", 1.0));
  EXPECT_NO_THROW(requireWithin("truth_rate", 1000.0));
  for (const double beyond : {0.999, 1000.001, kNoNumber, kInfinite})
    EXPECT_THROW(requireWithin("truth_rate", beyond), std::invalid_argument);
  try {
    requireWithin(Range{1.0, 2.0}, "/a/b", 2.5);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "parameter /a/b = 2.5 is outside its range 1..2");
  }
}

TEST(Statistics, RatesQualitiesAndClearing) {
  krc::Parameters parameters;
  krc::AnswerStatistics statistics(parameters);
  EXPECT_EQ(statistics.answerRate(), 0.0);
  EXPECT_EQ(statistics.missRate(), 1.0);
  EXPECT_EQ(statistics.latency(), 0.0);
  EXPECT_EQ(statistics.jitter(), 0.0);
  EXPECT_EQ(statistics.missCounter(), 0U);
  statistics.add(true, 0.002);
  EXPECT_EQ(statistics.latency(), 0.002);
  EXPECT_EQ(statistics.jitter(), 0.0);
  statistics.add(false, 9.0);
  statistics.add(true, 0.005);
  EXPECT_NEAR(statistics.latency(), 0.0035, 1e-15);
  EXPECT_NEAR(statistics.jitter(), 0.003, 1e-15);
  EXPECT_EQ(statistics.answerRate(), 0.02);
  statistics.clear();
  EXPECT_EQ(statistics.answerRate(), 0.0);
  EXPECT_EQ(statistics.latency(), 0.0);
  EXPECT_EQ(statistics.missCounter(), 1U);
  for (int i = 0; i < 250; ++i) statistics.add(true, 1e-3 * i);
  EXPECT_NEAR(statistics.latency(), 1e-3 * 199.5, 1e-12);
  EXPECT_NEAR(statistics.jitter(), 1e-3, 1e-12);
}

// -- sensors
// ---------------------------------------------------------------------------------------

TEST(TorqueSensor, NoiseGrowsWithTheFastestJointAndIsCorrelated) {
  TorqueNoise noise;
  noise.bias = noise.offset = noise.hysteresis = 0.0;
  const Vector7 none = Vector7::Zero();
  for (const double speed : {0.0, 1.0}) {
    TorqueSensor sensor(noise, 5);
    Vector7 velocity = Vector7::Zero();
    velocity[4] = -speed;
    double measured = 0.0, external = 0.0, product = 0.0, apart = 0.0;
    Vector7 before = none;
    constexpr int kSteps = 40000;
    for (int i = 0; i < kSteps; ++i) {
      sensor.advance(velocity, 0.005);
      const Vector7 now = sensor.measured(none), estimate = sensor.external(none, none);
      measured += now.squaredNorm() / 7.0;
      external += estimate.squaredNorm() / 7.0;
      product += now.dot(before) / 7.0;
      apart += now.dot(estimate) / 7.0;
      before = now;
    }
    const double sigma = 0.05 * (1.0 + 7.0 * speed);
    EXPECT_NEAR(std::sqrt(measured / kSteps), sigma, 0.03 * sigma);
    EXPECT_NEAR(std::sqrt(external / kSteps), sigma, 0.03 * sigma);
    EXPECT_NEAR(product / measured, std::exp(-0.5), 0.02);
    EXPECT_NEAR(apart / measured, 0.0, 0.02);
  }
}

TEST(TorqueSensor, TheOffsetOfTheEstimateDependsOnThePosture) {
  TorqueNoise noise;
  noise.sigma = noise.offset = noise.hysteresis = 0.0;
  double largest = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const TorqueSensor sensor(noise, seed);
    for (int joint = 0; joint < 7; ++joint) {
      Vector7 posture = Vector7::Zero();
      double lowest = 1.0, highest = -1.0, from = kNoNumber, crossings = 0.0;
      for (int i = 0; i <= 4000; ++i) {
        posture[joint] = 0.02 * i;
        const double bias = sensor.external(Vector7::Zero(), posture)[joint];
        lowest = std::min(lowest, bias);
        highest = std::max(highest, bias);
        if (from * bias < 0.0) ++crossings;
        from = bias;
      }
      EXPECT_NEAR(highest, 0.4, 1e-3);
      EXPECT_NEAR(lowest, -0.4, 1e-3);
      // A sine of 0.5 to 1.5 rad per rad.
      EXPECT_GE(crossings, 80.0 * 0.5 / M_PI - 1.0);
      EXPECT_LE(crossings, 80.0 * 1.5 / M_PI + 1.0);
      largest = std::max(largest, crossings);
    }
    EXPECT_EQ(sensor.measured(Vector7::Zero()).norm(), 0.0);
  }
  EXPECT_GT(largest, 80.0 * 1.3 / M_PI);
}

TEST(TorqueSensor, OffsetsAreAddedToTheSensorAndTakenFromTheEstimate) {
  TorqueNoise noise;
  noise.sigma = noise.bias = noise.hysteresis = 0.0;
  const TorqueSensor sensor(noise, 9);
  const Vector7 ideal = Vector7::LinSpaced(-3.0, 3.0), posture = Vector7::Ones();
  const Vector7 offset = sensor.measured(ideal) - ideal;
  EXPECT_LT((sensor.external(ideal, posture) - ideal + offset).norm(), 1e-12);
  EXPECT_LT(offset.minCoeff(), 0.0);
  EXPECT_GT(offset.maxCoeff(), 0.0);
}
