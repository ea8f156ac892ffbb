/// Independent parts of the plant: the motors of the hand, the hold of a free body, distances and
/// inertias of objects, the hand's table.
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

namespace {

/// A body of 2 kg about the origin.
FreeBody body() {
  FreeBody body;
  body.mass = 2.0;
  body.inertia = Vector3d(0.01, 0.02, 0.03);
  return body;
}

const HoldLimits kStrong{10.0, 1e6, 1e6};

Pose at(const Vector3d& position, const Vector3d& turn = Vector3d::Zero()) {
  const double angle = turn.norm();
  return {position, angle > 0.0 ? Quaterniond(Eigen::AngleAxisd(angle, turn / angle))
                                : Quaterniond::Identity()};
}

}  // namespace

TEST(HoldSpring, AnObjectHeldByAnotherIsTakenWithoutItsWeight) {
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
  const HoldLimits weak{10.0, 5.0, 1e6};
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
