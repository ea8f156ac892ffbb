/// The leash: a blocked arm stores no jump; conditions to trip, return and release.
#include <gtest/gtest.h>

#include <cmath>

#include "lwr_fri_bridge/motion/set_point_leash.hpp"
#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

using test::defaultConfig;
using test::drive;
using test::SmallController;

struct Blocked {
  Blocked(const char* mode, double speed) : bridge(defaultConfig()), robot(0.005) {
    for (int i = 0; i < 3; ++i) robot.cycle(bridge);
    EXPECT_TRUE(test::runEvent(bridge, robot, mode).success());
    EXPECT_TRUE(test::runEvent(bridge, robot, "start").success());
    robot.cycle(bridge);
    velocity[1] = speed;
    push(100);
    robot.blocked = true;
    blocked_at = robot.measured();
  }
  void push(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      drive(bridge, robot, velocity);
      robot.cycle(bridge);
      ahead = std::max(ahead, (robot.setPoint() - robot.measured()).cwiseAbs().maxCoeff());
    }
  }
  double stored() const { return (robot.setPoint() - robot.measured()).cwiseAbs().maxCoeff(); }
  Bridge bridge;
  SmallController robot;
  Vector7 velocity = Vector7::Zero();
  Vector7 blocked_at;
  double ahead = 0.0;
};

TEST(Leash, RelaxesABlockedArmInEveryMode) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    for (const double speed : {0.1, 0.5, 1.5, -1.5}) {
      Blocked cell(mode, speed);
      cell.push(1000);  // 5 s against the block
      const double leash = std::string(mode) == "position" ? 0.05 : 0.10;
      const double v = std::abs(speed);
      EXPECT_LE(cell.ahead, leash + 1.1 * coglab_rt::brakingDistance(v, 10.0, 500.0) + 0.01 * v)
          << mode << speed;
      EXPECT_LE(cell.stored(), 2e-3) << mode << speed;
      const Snapshot s = cell.bridge.snapshot();
      EXPECT_EQ(s.counters.leash_trips, 1U);
      EXPECT_EQ(s.sample.block, MotionBlock::Leashed);
      EXPECT_EQ(s.sample.blocking_joint, 1);
    }
  }
}

/// A soft arm sags under a load, or friction holds it back: this is no block. A stiff arm that lags
/// as far is blocked.
TEST(Leash, ASoftArmThatSagsIsNotBlocked) {
  for (const bool soft : {true, false}) {
    Bridge bridge(defaultConfig());
    SmallController robot(0.005);
    for (int i = 0; i < 3; ++i) robot.cycle(bridge);
    const std::string mode = soft ? "joint_impedance stiffness 30" : "joint_impedance";
    ASSERT_TRUE(test::runEvent(bridge, robot, mode).success());
    ASSERT_TRUE(test::runEvent(bridge, robot, "start").success());
    robot.blocked = true;  // the measured position is set here
    Vector7 sag = Vector7::Zero(), velocity = Vector7::Zero();
    sag[1] = 0.2;  // 6 Nm at 30 Nm/rad
    velocity[1] = 0.3;
    const double before = robot.setPoint()[1];
    for (int i = 0; i < 300; ++i) {
      robot.setMeasured(robot.setPoint() - sag);
      drive(bridge, robot, velocity);
      robot.cycle(bridge);
    }
    EXPECT_EQ(bridge.snapshot().counters.leash_trips, soft ? 0U : 1U);
    EXPECT_EQ(robot.setPoint()[1] > before + 0.3, soft);
  }
}

TEST(Leash, AnArmThatIsPushedOrSagsDoesNotDragTheSetPoint) {
  Bridge bridge(defaultConfig());
  SmallController robot(0.005);
  for (int i = 0; i < 3; ++i) robot.cycle(bridge);
  ASSERT_TRUE(test::runEvent(bridge, robot, "joint_impedance").success());
  ASSERT_TRUE(test::runEvent(bridge, robot, "start").success());
  const Vector7 set_point = robot.setPoint();
  robot.blocked = true;
  for (int i = 0; i < 400; ++i) {
    robot.setMeasured(set_point - Vector7::Constant(0.001 * i));
    drive(bridge, robot, Vector7::Zero());
    robot.cycle(bridge);
  }
  EXPECT_TRUE(robot.setPoint().isApprox(set_point, 1e-7));
  EXPECT_EQ(bridge.snapshot().counters.leash_trips, 0U);
}

constexpr double kLeash = 0.05;

/// A leash around an interpolator that stands at `position`, asked for `wanted`.
struct Tied {
  Tied() : limits(test::defaultConfig().limits), interpolator(limits) { place(Vector7::Zero()); }
  void place(const Vector7& position) { interpolator.reset(position); }
  /// One tick; whether it is tripped.
  bool tick(const Vector7& measured, const Vector7& wanted) {
    target = wanted;
    return leash.update(interpolator, measured, wanted, Vector7::Constant(kLeash), limits, target);
  }
  JointLimits limits;
  Interpolator interpolator;
  SetPointLeash leash;
  Vector7 target = Vector7::Zero();
};

Vector7 unit(int joint, double value) {
  Vector7 v = Vector7::Zero();
  v[joint] = value;
  return v;
}

TEST(LeashEdges, EveryJointTripsBeyondItsLeashAndIsNamed) {
  for (int joint = 0; joint < 7; ++joint) {
    for (const double sign : {-1.0, 1.0}) {
      Tied tied;
      tied.tick(unit(joint, -sign * 0.0499), unit(joint, sign * 0.2));
      EXPECT_EQ(tied.leash.joint(), -1);
      EXPECT_EQ(tied.target, unit(joint, sign * 0.2));  // left alone
      EXPECT_TRUE(!tied.tick(unit(joint, -sign * 0.0501), unit(joint, sign * 0.2)));
      EXPECT_TRUE(tied.tick(unit(joint, -sign * 0.0501), unit(joint, sign * 0.2)));
      EXPECT_EQ(tied.leash.joint(), joint);
    }
  }
}

/// Of two measurements the one nearer to the set-point counts, on either side of it.
TEST(LeashEdges, OneFalseMeasurementTripsNothing) {
  for (const double false_one : {-0.3, 0.3}) {
    Tied tied;
    const Vector7 wanted = unit(0, std::copysign(0.2, -false_one));
    EXPECT_FALSE(tied.tick(Vector7::Zero(), wanted));
    EXPECT_FALSE(tied.tick(unit(0, false_one), wanted));
    EXPECT_FALSE(tied.tick(Vector7::Zero(), wanted));
    EXPECT_FALSE(tied.tick(unit(0, false_one), wanted));
    EXPECT_TRUE(tied.tick(unit(0, false_one), wanted));
    tied.leash.reset();
    EXPECT_EQ(tied.leash.joint(), -1);
    // After a reset there is no measurement before: the first one counts.
    EXPECT_TRUE(tied.tick(unit(0, false_one), wanted));
  }
}

TEST(LeashEdges, OnlyMotionAwayFromTheArmTrips) {
  for (const double sign : {-1.0, 1.0}) {
    Tied tied;
    const Vector7 arm = unit(3, -sign * 0.1);  // the set-point is ahead of it
    EXPECT_FALSE(tied.tick(arm, Vector7::Zero()));
    EXPECT_FALSE(tied.tick(arm, Vector7::Zero()));
    EXPECT_FALSE(tied.tick(arm, unit(3, -sign * 0.2)));  // back to the arm
    EXPECT_FALSE(tied.tick(arm, unit(2, sign * 0.2)));   // another joint
    EXPECT_TRUE(tied.tick(arm, unit(3, sign * 0.001)));
    // The set-point's own speed counts beside what is asked for.
    Tied moving;
    moving.interpolator.resume(Vector7::Zero(), unit(3, sign * 0.1), Vector7::Zero());
    EXPECT_TRUE(moving.tick(arm, Vector7::Zero()));
  }
}

/// Home is the arm's position at the trip, even if it is pushed afterwards. The leash releases
/// within 1 mrad of it when the outward motion is no longer requested.
TEST(LeashEdges, ReleasesAtHomeWithoutTheOldRequest) {
  for (const double sign : {-1.0, 1.0}) {
    Tied tied;
    const Vector7 arm = unit(1, -sign * 0.06), outward = unit(1, sign * 0.2);
    ASSERT_TRUE(tied.tick(arm, outward));
    EXPECT_TRUE(tied.tick(arm + unit(1, 0.5), Vector7::Zero()));  // pushed: home stays
    tied.place(arm + unit(1, sign * 1.1e-3));
    EXPECT_TRUE(tied.tick(arm, Vector7::Zero()));
    EXPECT_LT(sign * tied.target[1], 0.0);
    tied.place(arm + unit(1, sign * 0.9e-3));
    EXPECT_TRUE(tied.tick(arm, outward));
    EXPECT_TRUE(tied.tick(arm, outward + unit(2, 0.1)));
    EXPECT_EQ(tied.leash.joint(), 1);
    EXPECT_FALSE(tied.tick(arm, -outward));
    EXPECT_EQ(tied.leash.joint(), -1);
  }
}

TEST(LeashEdges, LengthsFollowTheRuleForEachJoint) {
  const LeashLengths lengths{0.02, 0.06, 30.0};
  ControlMode mode;
  EXPECT_EQ(leashOf(mode, lengths), Vector7::Constant(0.02));
  mode.strategy = fri::ControlStrategy::Other;
  EXPECT_EQ(leashOf(mode, lengths), Vector7::Constant(0.02));
  mode.strategy = fri::ControlStrategy::JointImpedance;
  mode.joint_stiffness << 100, 200, 90, 120, 40, 60, 30;
  Vector7 expected;
  expected << 0.3, 0.15, 0.2, 0.15, 0.15, 0.1, 0.2;  // 30 N at 1, 0.6 and 0.2 m
  EXPECT_TRUE(leashOf(mode, lengths).isApprox(expected, 1e-12));
  mode.strategy = fri::ControlStrategy::CartesianImpedance;
  for (int soft = 0; soft < 6; ++soft) {
    mode.cartesian_stiffness << 5000, 5000, 5000, 300, 300, 300;
    mode.cartesian_stiffness[soft] = soft < 3 ? 500.0 : 20.0;
    const double length = soft < 3 ? 30.0 / (500.0 * 0.4) + 30.0 * 0.1 / 300.0
                                   : 30.0 / (5000.0 * 0.4) + 30.0 * 0.1 / 20.0;
    EXPECT_TRUE(leashOf(mode, lengths).isApprox(Vector7::Constant(length), 1e-12)) << soft;
  }
  EXPECT_EQ(leashOf(ControlMode(), {0.6, 0.1, 0.0}), Vector7::Constant(0.5));
}

}  // namespace
}  // namespace lwr_fri_bridge
