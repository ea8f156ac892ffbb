/// The parts of the plant that compute by themselves: the motors of the hand, the hold of a free
/// body, distances and inertias of objects, the hand's table.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "coglab_sim/plant/plant.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

namespace {

using Tensions = std::array<double, kMotors>;

/// Motors of the hand that is built in, all with the same tension.
struct Motors {
  HandMotors motors{builtInHandTable()};
  void step(double tension, int steps = 1, double dt = 0.001) {
    Tensions all;
    all.fill(tension);
    for (int i = 0; i < steps; ++i) motors.step(all, dt);
  }
  const MotorState& state() const { return motors.state(2); }
};

}  // namespace

TEST(HandMotors, BeginOpenAndOff) {
  Motors hand;
  hand.step(0.0, 100);
  for (int motor = 0; motor < kMotors; ++motor) {
    const MotorState& state = hand.motors.state(motor);
    EXPECT_EQ(state.position, 0.0);
    EXPECT_EQ(state.current, 0.0);
    EXPECT_FALSE(state.moving);
    EXPECT_FALSE(state.locked);
  }
}

TEST(HandMotors, WindAtTheirSpeedAndDrawMoreForIt) {
  Motors hand;
  hand.motors.command(2, {0.5, 0.8, 1000.0});
  hand.step(0.0, 100);
  EXPECT_NEAR(hand.state().position, 0.05, 1e-12);  // a stroke a second at full speed
  EXPECT_TRUE(hand.state().moving);
  EXPECT_NEAR(hand.state().current, 40.0 + 60.0 * 0.5, 1e-9);
  EXPECT_EQ(hand.motors.state(1).position, 0.0);
  hand.step(0.0, 2000);
  EXPECT_NEAR(hand.state().position, 0.8, 1e-12);
  EXPECT_FALSE(hand.state().moving);
  EXPECT_EQ(hand.state().current, 0.0);
  hand.motors.command(2, {1.0, 0.3, 1000.0});
  hand.step(0.0, 100);
  EXPECT_NEAR(hand.state().position, 0.7, 1e-12);
  EXPECT_NEAR(hand.state().current, 100.0, 1e-9);
  hand.step(0.0, 1, 10.0);
  EXPECT_NEAR(hand.state().position, 0.3, 1e-12);  // a step is no longer than the way
}

TEST(HandMotors, TensionAndEffortAreToldWhateverAMotorDoes) {
  Motors hand;
  hand.step(-45.0);
  EXPECT_EQ(hand.state().tension, 45.0);
  EXPECT_NEAR(hand.state().effort, 400.0 * 45.0 / 90.0, 1e-9);
  EXPECT_NEAR(hand.motors.state(4).effort, 400.0 * 45.0 / 180.0, 1e-9);
  EXPECT_EQ(hand.state().current, 0.0);
}

TEST(HandMotors, SlowDownOverTheLastFifthBeforeTheyStop) {
  // 240 counts are 200 above what a free motor draws: half of the stall's 400, 45 of 90 N.
  for (const auto& [tension, share] : {std::pair{0.0, 1.0},
                                       {35.9, 1.0},
                                       {36.1, 0.9889},
                                       {40.5, 0.5},
                                       {44.1, 0.1},
                                       {45.0, 0.0},
                                       {60.0, 0.0}}) {
    Motors hand;
    hand.motors.command(2, {1.0, 1.0, 240.0});
    hand.step(tension, 100);
    EXPECT_NEAR(hand.state().position, 0.1 * share, 2e-5) << tension;
    EXPECT_EQ(hand.state().moving, share > 0.05) << tension;
    EXPECT_NEAR(hand.state().current, 40.0 + 60.0 * share + 400.0 * tension / 90.0, 0.01)
        << tension;
  }
  Motors free;  // no more than the limit, however many counts are asked for
  free.motors.command(2, {1.0, 1.0, 5000.0});
  free.step(81.0, 100);
  EXPECT_NEAR(free.state().position, 0.05, 1e-9);
  Motors weak;  // the current of a motor that runs free winds nothing that resists
  weak.motors.command(2, {1.0, 1.0, 40.0});
  weak.step(0.001, 100);
  EXPECT_EQ(weak.state().position, 0.0);
}

TEST(HandMotors, AnOpeningMotorIsSlowedByNoTension) {
  Motors hand;
  hand.motors.set(2, 0.5);
  hand.motors.command(2, {1.0, 0.0, 50.0});
  hand.step(80.0, 100);
  EXPECT_NEAR(hand.state().position, 0.4, 1e-12);
  EXPECT_NEAR(hand.state().current, 100.0, 1e-9);
}

TEST(HandMotors, LockWhereTheyAreNearlyStoppedAndUnlockByAnotherCommand) {
  Motors hand;
  hand.motors.command(2, {1.0, 1.0, 240.0});
  hand.step(45.0, 198);
  EXPECT_FALSE(hand.state().locked);
  hand.step(45.0, 4);
  EXPECT_TRUE(hand.state().locked);
  hand.step(0.0, 100);
  EXPECT_EQ(hand.state().position, 0.0);
  EXPECT_EQ(hand.state().current, 0.0);
  EXPECT_FALSE(hand.state().moving);
  hand.motors.command(2, {1.0, 1.0, 240.0});
  EXPECT_TRUE(hand.state().locked) << "the same command once more";
  for (const MotorCommand& other : {MotorCommand{0.9, 1.0, 240.0}, MotorCommand{0.9, 0.9, 240.0},
                                    MotorCommand{0.9, 0.9, 250.0}}) {
    hand.motors.command(2, other);
    EXPECT_FALSE(hand.state().locked);
    hand.step(60.0, 205);
    EXPECT_TRUE(hand.state().locked);
  }
}

TEST(HandMotors, AMovementInBetweenBeginsTheWaitingAnew) {
  Motors hand;
  hand.motors.command(2, {1.0, 1.0, 240.0});
  for (int i = 0; i < 5; ++i) {
    hand.step(45.0, 150);
    hand.step(0.0, 1);
  }
  EXPECT_FALSE(hand.state().locked);
  hand.step(45.0, 150);
  hand.motors.set(2, 0.4);
  hand.motors.command(2, {1.0, 1.0, 240.0});
  hand.step(45.0, 150);
  EXPECT_FALSE(hand.state().locked);
}

TEST(HandMotors, CommandsAndPlacesAreCutToWhatTheyCanBe) {
  Motors hand;
  hand.motors.command(2, {7.0, 1.7, -5.0});
  hand.step(0.0, 100);
  EXPECT_LT(hand.state().position, 0.1 + 1e-9);
  hand.motors.command(2, {7.0, 1.7, 1000.0});
  hand.step(0.0, 3000);
  EXPECT_EQ(hand.state().position, 1.0);
  hand.motors.command(2, {-1.0, 0.0, 1000.0});
  hand.step(0.0, 100);
  EXPECT_EQ(hand.state().position, 1.0);
  hand.motors.command(2, {1.0, -3.0, 1000.0});
  hand.step(0.0, 3000);
  EXPECT_EQ(hand.state().position, 0.0);
  for (const auto& [given, is] : {std::pair{-0.5, 0.0}, {0.25, 0.25}, {1.5, 1.0}}) {
    hand.motors.set(2, given);
    hand.step(0.0, 100);
    EXPECT_EQ(hand.state().position, is);  // off: it stays
  }
}

TEST(HandMotors, WhatIsWoundFollowsTheStroke) {
  Motors hand;
  const HandTable& table = builtInHandTable();
  for (int motor = 0; motor < kMotors; ++motor) {
    const MotorRow& row = table.motors[static_cast<std::size_t>(motor)];
    EXPECT_EQ(hand.motors.wound(motor), row.open_length);
    hand.motors.set(motor, 0.5);
    EXPECT_NEAR(hand.motors.wound(motor), row.open_length + 0.5 * row.stroke, 1e-15);
  }
}

TEST(HandTable, TheOneThatIsBuiltIn) {
  const HandTable& hand = builtInHandTable();
  EXPECT_EQ(hand.palm, "ih2_base_link");
  ASSERT_EQ(hand.phalanges.size(), 11U);
  const int motors[] = {0, 1, 1, 2, 2, 3, 3, 4, 4, 4, 4};
  const int fingers[] = {0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4};
  const double springs[] = {0.04, 0.04, 0.05, 0.04, 0.05, 0.04, 0.05, 0.04, 0.05, 0.04, 0.05};
  for (std::size_t i = 0; i < 11; ++i) {
    EXPECT_EQ(hand.phalanges[i].motor, motors[i]) << i;
    EXPECT_EQ(static_cast<int>(hand.phalanges[i].finger), fingers[i]) << i;
    EXPECT_EQ(hand.phalanges[i].first, i == 0 || fingers[i] != fingers[i - 1]) << i;
    EXPECT_EQ(hand.phalanges[i].spring, springs[i]) << i;
  }
  const Phalanx& thumb = hand.phalanges[1];
  EXPECT_EQ(thumb.name, "thumb_proximal");
  EXPECT_EQ(thumb.pivot, Vector3d(0.0, 0.026, 0.0));
  EXPECT_EQ(thumb.axis, Vector3d(1.0, 0.0, 0.0));
  EXPECT_EQ(thumb.along, Vector3d(0.0, 1.0, 0.0));
  EXPECT_EQ(thumb.lower, -0.349);
  EXPECT_EQ(thumb.upper, 1.222);
  EXPECT_EQ(thumb.arm, 0.010);
  EXPECT_EQ(thumb.length, 0.042);
  EXPECT_EQ(thumb.radius, 0.009);
  EXPECT_EQ(thumb.mass, 0.014);
  EXPECT_NEAR(hand.phalangesMass(), 0.133, 1e-12);
  const double strokes[] = {0.0192, 0.025482, 0.028795, 0.028795, 0.028795};
  const double opened[] = {0.0, -0.00349, 0.0, 0.0, 0.0};
  const double limits[] = {90.0, 90.0, 90.0, 90.0, 180.0};
  const char* names[] = {"thumb_abduction", "thumb", "index", "middle", "ring_little"};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(hand.motors[i].stroke, strokes[i], 1e-9) << i;
    EXPECT_NEAR(hand.motors[i].open_length, opened[i], 1e-12) << i;
    EXPECT_EQ(hand.motors[i].limit, limits[i]);
    EXPECT_EQ(hand.motors[i].both_ways, i == 0);
    EXPECT_EQ(hand.motors[i].name, names[i]);
  }
  EXPECT_EQ(hand.sliding, 0.8);
  EXPECT_EQ(hand.torsional, 0.004);
  EXPECT_EQ(hand.rolling, 0.0001);
  EXPECT_EQ(hand.joint_damping, 0.012);
  EXPECT_EQ(hand.joint_armature, 0.0002);
  EXPECT_EQ(hand.tendon_stiffness, 5e4);
  EXPECT_EQ(hand.full_stroke, 1.0);
  EXPECT_EQ(hand.lock_share, 0.05);
  EXPECT_EQ(hand.lock_time, 0.2);
  EXPECT_EQ(hand.free_current, 40.0);
  EXPECT_EQ(hand.speed_current, 60.0);
  EXPECT_EQ(hand.stall_current, 400.0);
}

namespace {

/// A body of 2 kg about the origin.
FreeBody body() {
  FreeBody body;
  body.mass = 2.0;
  body.inertia = Vector3d(0.01, 0.02, 0.03);
  return body;
}

const HoldFigures kStrong{10.0, 1e6, 1e6};

Pose at(const Vector3d& position, const Vector3d& turn = Vector3d::Zero()) {
  const double angle = turn.norm();
  return {position, angle > 0.0 ? Quaterniond(Eigen::AngleAxisd(angle, turn / angle))
                                : Quaterniond::Identity()};
}

}  // namespace

TEST(HoldSpring, IsNothingUntilItIsEngagedOrWhereItHasFaded) {
  HoldSpring hold;
  EXPECT_FALSE(hold.engaged());
  EXPECT_EQ(hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 1.0).stacked().norm(), 0.0);
  hold.engageAt(Pose{});
  EXPECT_TRUE(hold.engaged());
  EXPECT_EQ(hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 0.0).stacked().norm(), 0.0);
  EXPECT_GT(hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 0.1).stacked().norm(), 0.0);
  hold.release();
  EXPECT_FALSE(hold.engaged());
  EXPECT_EQ(hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 1.0).stacked().norm(), 0.0);
}

TEST(HoldSpring, GainsFollowFromMassInertiaAndBandwidth) {
  HoldSpring hold;
  hold.engageAt(Pose{});
  FreeBody held = body();
  held.twist = {Vector3d(0.1, 0.2, 0.3), Vector3d(0.4, 0.5, 0.6)};
  const Twist hand{Vector3d(0.3, 0.3, 0.3), Vector3d(1.0, 1.0, 1.0)};
  const Wrench all =
      hold.evaluate(at({0.01, -0.02, 0.03}, {0.0, 0.0, 0.2}), hand, held, kStrong, 1.0);
  const Vector3d force = 2.0 * 100.0 * Vector3d(0.01, -0.02, 0.03) +
                         2.0 * 10.0 * 2.0 * Vector3d(0.2, 0.1, 0.0) +
                         Vector3d(0.0, 0.0, 2.0 * 9.81);
  EXPECT_LT((all.force - force).norm(), 1e-9) << all.force.transpose();
  const Vector3d torque(20.0 * 0.01 * 0.6, 20.0 * 0.02 * 0.5,
                        100.0 * 0.03 * 0.2 + 20.0 * 0.03 * 0.4);
  EXPECT_LT((all.torque - torque).norm(), 1e-9) << all.torque.transpose();
  const Wrench half =
      hold.evaluate(at({0.01, -0.02, 0.03}, {0.0, 0.0, 0.2}), hand, held, kStrong, 0.5);
  EXPECT_LT((half.stacked() - 0.5 * all.stacked()).norm(), 1e-9);
}

TEST(HoldSpring, APlaceInTheHandTurnsAndMovesWithIt) {
  HoldSpring hold;
  hold.engageAt(at({0.2, 0.0, 0.0}));
  FreeBody held = body();
  held.center = at({1.0, 2.2, 3.0}, {0.0, 0.0, M_PI / 2});
  const Twist spin{Vector3d::Zero(), Vector3d(0.0, 0.0, 2.0)};
  const Wrench wrench =
      hold.evaluate(at({1.0, 2.0, 3.0}, {0.0, 0.0, M_PI / 2}), spin, held, kStrong, 1.0);
  // It is where it belongs; the place goes at 2 rad/s x 0.2 m along -x.
  EXPECT_LT((wrench.force - Vector3d(-2.0 * 10.0 * 2.0 * 0.4, 0.0, 2.0 * 9.81)).norm(), 1e-9);
  EXPECT_LT((wrench.torque - Vector3d(0.0, 0.0, 20.0 * 0.03 * 2.0)).norm(), 1e-9);
  // Inertias are those of the body's own axes.
  held.center.rotation = Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitX()));
  const Wrench about =
      hold.evaluate(at({1.0, 2.0, 3.0}, {M_PI / 2, 0.0, 0.0}), spin, held, kStrong, 1.0);
  EXPECT_NEAR(about.torque.z(), 20.0 * 0.02 * 2.0, 1e-9);
}

TEST(HoldSpring, WhatAnotherHoldsIsTakenWithoutItsWeight) {
  HoldSpring hold;
  hold.engageAt(Pose{});
  hold.engage(at({1, 0, 0}), at({0, 0, 0}));
  const Wrench at_first = hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 1.0);
  EXPECT_LT(at_first.stacked().norm(), 1e-12);
  EXPECT_NEAR(hold.evaluate(at({1, 0, 0.01}), {}, body(), kStrong, 1.0).force.z(), 2.0, 1e-9);
  hold.engageAt(at({-1, 0, 0}));
  EXPECT_NEAR(hold.evaluate(at({1, 0, 0}), {}, body(), kStrong, 1.0).force.z(), 19.62, 1e-9);
}

TEST(HoldSpring, BeyondItsForceThePlaceFollows) {
  HoldSpring hold;
  hold.engage(Pose{}, Pose{});
  const HoldFigures weak{10.0, 5.0, 1e6};
  Wrench wrench = hold.evaluate(at({0.1, 0, 0}), {}, body(), weak, 1.0);  // 20 N are asked for
  EXPECT_LT((wrench.force - Vector3d(5.0, 0.0, 0.0)).norm(), 1e-9);
  // Now the spring alone carries what the limit can.
  wrench = hold.evaluate(at({0.1, 0, 0}), {}, body(), kStrong, 1.0);
  EXPECT_NEAR(wrench.force.x(), 5.0, 1e-9);
  // A damper beyond the limit moves no place.
  HoldSpring damped;
  damped.engage(Pose{}, Pose{});
  FreeBody fast = body();
  fast.twist.linear = Vector3d(0.0, 3.0, 0.0);
  EXPECT_NEAR(damped.evaluate(Pose{}, {}, fast, weak, 1.0).force.y(), -5.0, 1e-9);
  EXPECT_LT(damped.evaluate(Pose{}, {}, body(), kStrong, 1.0).force.norm(), 1e-12);
  // In the axes of a hand that is turned, and with a hold that has half faded.
  HoldSpring turned;
  const Pose hand = at({0, 0, 0}, {0.0, 0.0, M_PI / 2});
  turned.engage(hand, Pose{});
  Pose away = hand;
  away.position = Vector3d(0.1, 0.0, 0.0);
  EXPECT_NEAR(turned.evaluate(away, {}, body(), weak, 0.5).force.x(), 5.0, 1e-9);
  EXPECT_NEAR(turned.evaluate(away, {}, body(), kStrong, 0.5).force.x(), 5.0, 1e-9);
}

TEST(HoldSpring, BeyondItsTorqueTheTurnFollows) {
  HoldSpring hold;
  hold.engage(Pose{}, Pose{});
  const HoldFigures weak{10.0, 1e6, 0.5};
  Wrench wrench = hold.evaluate(at({0, 0, 0}, {0, 0, 0.4}), {}, body(), weak, 1.0);  // 1.2 Nm
  EXPECT_LT((wrench.torque - Vector3d(0.0, 0.0, 0.5)).norm(), 1e-9);
  wrench = hold.evaluate(at({0, 0, 0}, {0, 0, 0.4}), {}, body(), kStrong, 1.0);
  EXPECT_LT((wrench.torque - Vector3d(0.0, 0.0, 0.5)).norm(), 1e-9) << wrench.torque.transpose();
  HoldSpring damped;
  damped.engage(Pose{}, Pose{});
  FreeBody fast = body();
  fast.twist.angular = Vector3d(0.0, 9.0, 0.0);
  EXPECT_NEAR(damped.evaluate(Pose{}, {}, fast, weak, 1.0).torque.y(), -0.5, 1e-9);
  EXPECT_LT(damped.evaluate(Pose{}, {}, body(), kStrong, 1.0).torque.norm(), 1e-12);
}
