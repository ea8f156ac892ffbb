#include "coglab_sim/limit_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "coglab_rt/joint_limits_table.hpp"

using coglab_rt::Vector7;
using coglab_sim::LimitWatch;

namespace {

constexpr double kPeriod = 0.005;  // s

Vector7 unit(int joint) { return Vector7::Unit(joint); }

TEST(LimitWatch, CountsATrueJointThatMovesTooFastForAnyCommand) {
  LimitWatch limits(LIMITS_FILE);
  // As published: the KRC's file rsidef7.dat, the same in the robot description.
  Vector7 fastest;
  fastest << 110.0, 110.0, 112.5, 112.5, 130.0, 112.5, 112.5;
  fastest *= M_PI / 180.0;
  for (int joint = 0; joint < 7; ++joint) {
    limits.lookAtArm(Vector7::Zero(), 0.9999 * fastest[joint] * unit(joint));
    EXPECT_EQ(limits.outside().measured, joint);
    EXPECT_EQ(limits.outside().over_command, 2 * joint + 1);
    limits.lookAtArm(Vector7::Zero(), 1.0001 * fastest[joint] * unit(joint));
    EXPECT_EQ(limits.outside().measured, joint + 1);
    EXPECT_EQ(limits.outside().over_command, 2 * joint + 2);
  }
  EXPECT_GT(limits.measuredShare(), 1.0);
  EXPECT_EQ(limits.peakShare(), 0.0);
  EXPECT_EQ(limits.outside().commanded, 0);
}

TEST(LimitWatch, CountsATrueJointBeyondItsRangeWithoutTolerance) {
  const auto table = coglab_rt::loadJointLimits(LIMITS_FILE);
  LimitWatch limits(LIMITS_FILE);
  limits.lookAtArm(table.upper_position, Vector7::Zero());
  limits.lookAtArm(table.lower_position, Vector7::Zero());
  EXPECT_EQ(limits.outside().measured, 0);
  Vector7 far = table.upper_position;
  far[3] = std::nextafter(far[3], 10.0);
  limits.lookAtArm(far, Vector7::Zero());
  far[3] = std::numeric_limits<double>::quiet_NaN();
  limits.lookAtArm(far, Vector7::Zero());
  EXPECT_EQ(limits.outside().measured, 2);
}

TEST(LimitWatch, CountsCommandsThatAreTooFastWhileTheArmFollowsThem) {
  const auto table = coglab_rt::loadJointLimits(LIMITS_FILE);
  LimitWatch limits(LIMITS_FILE);
  Vector7 position = Vector7::Zero();
  limits.lookAtCommand(position, true, kPeriod);
  const auto command = [&](int joint, double speed, bool follows = true) {
    position += kPeriod * speed * unit(joint);
    limits.lookAtCommand(position, follows, kPeriod);
    return limits.outside().commanded;
  };
  for (int joint = 0; joint < 7; ++joint) {
    // 4e-4: rounding of the positions to float32 adds so much.
    EXPECT_EQ(command(joint, -table.velocity[joint] - 4e-4), joint);
    EXPECT_EQ(command(joint, table.velocity[joint] + 6e-4), joint + 1);
  }
  EXPECT_EQ(command(3, 50.0, false), 7);
  EXPECT_EQ(command(3, 50.0), 7) << "nothing to compare with after a stop";
  EXPECT_EQ(command(3, 50.0), 8);
}

TEST(LimitWatch, CountsCommandsThatAreTooFarThoughTheArmStands) {
  const auto table = coglab_rt::loadJointLimits(LIMITS_FILE);
  LimitWatch limits(LIMITS_FILE);
  for (int joint = 0; joint < 7; ++joint) {
    limits.lookAtCommand(table.upper_position, false, kPeriod);
    limits.lookAtCommand(table.lower_position, false, kPeriod);
    EXPECT_EQ(limits.outside().commanded, 2 * joint);
    limits.lookAtCommand(table.upper_position + 1e-9 * unit(joint), false, kPeriod);
    limits.lookAtCommand(table.lower_position - 1e-9 * unit(joint), false, kPeriod);
  }
  EXPECT_EQ(limits.outside().commanded, 14);
}

}  // namespace
