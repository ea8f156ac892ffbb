/// What samples, commands, limits and answers say before anybody has filled them in, the sizes of
/// their vectors, and the one clock.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/clock.hpp"
#include "coglab_rt/joint_limits.hpp"
#include "coglab_rt/reason.hpp"

namespace coglab_rt {
namespace {

TEST(StartingValues, ASampleThatNobodyMeasuredIsDisconnectedAndAllZero) {
  const RobotSample sample;
  EXPECT_EQ(sample.sequence, 0U);
  EXPECT_EQ(sample.stamp_ns, 0);
  EXPECT_EQ(sample.cycle_time, 0.0);
  EXPECT_EQ(sample.controller_ns, 0);
  for (const Vector7& vector :
       {sample.position, sample.velocity, sample.torque, sample.external_torque,
        sample.commanded_position, sample.commanded_velocity, sample.commanded_acceleration}) {
    EXPECT_TRUE(vector.isZero(0.0));
  }
  EXPECT_TRUE(sample.tool_wrench.isZero(0.0));
  EXPECT_EQ(sample.block, MotionBlock::Disconnected);
  EXPECT_EQ(sample.blocking_joint, -1);
  EXPECT_EQ(sample.motion_epoch, 0U);
  EXPECT_EQ(sample.stop_delay, 0.0);
  EXPECT_EQ(sample.stop_rounding, 0.0);
}

TEST(StartingValues, ACommandThatNobodySentIsNone) {
  const VelocityCommand command;
  EXPECT_TRUE(command.velocity.isZero(0.0));
  EXPECT_EQ(command.stamp_ns, 0);
  EXPECT_EQ(command.motion_epoch, 0U);
}

TEST(StartingValues, AVectorHasOneEntryPerJointAndAWrenchSix) {
  EXPECT_EQ(Vector7::SizeAtCompileTime, 7);
  EXPECT_EQ(Vector7::ColsAtCompileTime, 1);
  EXPECT_EQ(Vector6::SizeAtCompileTime, 6);
  EXPECT_EQ(Vector6::ColsAtCompileTime, 1);
  EXPECT_EQ(JointLimits().names.size(), 7U);
  EXPECT_EQ(JointLimits().position_margin, 0.01);
}

TEST(StartingValues, AnAnswerIsGoodUntilItIsARefusal) {
  const Answer good;
  EXPECT_TRUE(good.success);
  EXPECT_EQ(good.number(), 0);
  EXPECT_EQ(good.message, "");
  const Answer invalid = Answer::invalid("no number");
  EXPECT_FALSE(invalid.success);
  EXPECT_EQ(invalid.number(), 100);
  EXPECT_EQ(invalid.message, "no number");
  const Answer busy = Answer::refusal(ReasonCode::Busy, "later");
  EXPECT_FALSE(busy.success);
  EXPECT_EQ(busy.code, ReasonCode::Busy);
  EXPECT_EQ(busy.message, "later");
}

/// Only what the person at the arm can undo by an event has a way out.
TEST(StartingValues, TheWayOutIsAnEventOrNone) {
  for (int i = 0; i < 256; ++i) {
    const auto block = static_cast<MotionBlock>(i);
    const bool start = block == MotionBlock::Monitor || block == MotionBlock::NoPower ||
                       block == MotionBlock::NotStarted;
    const std::string expected = start ? "start" : block == MotionBlock::Held ? "reset" : "";
    EXPECT_EQ(wayOut(block), expected) << describe(block);
  }
  EXPECT_EQ(codeOf(static_cast<MotionBlock>(200)), ReasonCode::NotStarted);
}

TEST(StartingValues, AnArmThatSaysNothingElseLeavesNoPriorityAboveIt) {
  struct Silent : ArmPort {
    ArmMailboxes& mailboxes() override { return boxes; }
    void start(Wake) override {}
    void setControllerActive(bool) override {}
    void shutdown() override {}
    ArmMailboxes boxes;
  } arm;
  EXPECT_EQ(arm.highestPriority(), 99);
}

TEST(StartingValues, TheClockIsTheSteadyOneInNanoseconds) {
  const auto read = [] {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  };
  const std::int64_t before = read(), now = steadyNow(), after = read();
  EXPECT_LE(before, now);
  EXPECT_LE(now, after);
  EXPECT_EQ(kFutureAllowance_ns, 50'000'000);
}

}  // namespace
}  // namespace coglab_rt
