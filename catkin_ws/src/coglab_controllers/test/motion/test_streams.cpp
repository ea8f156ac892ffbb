// Streams of velocities: following, stopping, and limits under any command.
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_controllers/plugins/stream_controller.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"
#include "motion_types.hpp"

namespace coglab_controllers {
namespace {

using Numbers = std::vector<double>;

struct Stream : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "]}"};
  StreamController* stream = nullptr;

  void SetUp() override { arm.followWithinLimits(); }

  void use(const std::string& type) {
    std::string active;
    ASSERT_TRUE(arm.manager->load("stream", type).success);
    ASSERT_TRUE(arm.manager->switchTo("stream", active).success);
    stream = dynamic_cast<StreamController*>(arm.manager->motion("stream"));
    ASSERT_NE(stream, nullptr);
    const MotionAnswer answer = stream->open();
    ASSERT_TRUE(answer.success) << answer.message;
  }
  /// Sends one command, and runs the cycles until the next one at 20 Hz.
  void follow(const Numbers& command) {
    ASSERT_TRUE(stream->send(command).success);
    arm.run(0.05);
  }
  /// Checks set-point and reference against every limit of the arm.
  void expectWithinLimits() {
    const RobotSetup& robot = *arm.manager->settings().robot;
    const auto& limits = arm.limits;
    for (int i = 0; i < 7; ++i) {
      ASSERT_LE(std::abs(arm.sample.velocity[i]), limits.velocity[i] + 1e-9) << "joint " << i;
      ASSERT_GE(arm.sample.position[i], limits.lower_position[i]) << "joint " << i;
      ASSERT_LE(arm.sample.position[i], limits.upper_position[i]) << "joint " << i;
    }
    ASSERT_LE(arm.handVelocity().norm(), robot.guard.hand_speed + 1e-6);
    ASSERT_EQ(robot.workspace.violated(arm.hand().position), WorkspaceBorder::None);
  }
  void expectLimitsKept(double scale, int size) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> draw(-scale, scale);
    for (int command = 0; command < 200; ++command) {
      Numbers numbers(static_cast<std::size_t>(size));
      for (double& number : numbers) number = draw(random);
      // Some last long, so that the arm comes to its limits.
      for (int times = command % 5 == 0 ? 20 : 1; times > 0; --times) {
        ASSERT_TRUE(stream->send(numbers).success) << arm.reason();
        for (int tick = 0; tick < 10; ++tick) {
          arm.tick();
          expectWithinLimits();
          if (HasFatalFailure()) return;
        }
      }
    }
    EXPECT_TRUE(stream->isOpen()) << arm.reason();
  }
};

TEST_F(Stream, TheHandFollowsATwistInTheBaseFrame) {
  use("coglab/TwistStream");
  const Pose home = arm.hand();
  for (int i = 0; i < 20; ++i) follow({0.05, 0.0, 0.1, 0.0, 0.0, 0.2});
  const Vector3 way = arm.hand().position - home.position;
  EXPECT_NEAR(way.x(), 0.05, 0.006);
  EXPECT_NEAR(way.y(), 0.0, 0.003);
  EXPECT_NEAR(way.z(), 0.1, 0.008);
  const Vector3 turned = rotationBetween(home.orientation, arm.hand().orientation);
  EXPECT_NEAR(turned.z(), 0.2, 0.02);
  EXPECT_NEAR(turned.head<2>().norm(), 0.0, 0.01);
  EXPECT_EQ(arm.state(), MotionState::Running);
}

TEST_F(Stream, ATwistInTheToolFrameTurnsWithTheHand) {
  use("coglab/TwistStream");
  const Pose home = arm.hand();
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(stream->send({{0.0, 0.05, 0.0, 0.0, 0.0, 0.4}, 0.0, true}).success);
    arm.run(0.05);
  }
  // Forward in its own y axis while it turns about its own z axis: an arc.
  const Vector3 way = home.orientation.conjugate() * (arm.hand().position - home.position);
  EXPECT_NEAR(way.y(), 0.05 / 0.4 * std::sin(0.4), 0.006);
  EXPECT_NEAR(way.x(), -0.05 / 0.4 * (1.0 - std::cos(0.4)), 0.004);
  EXPECT_NEAR(way.z(), 0.0, 0.003);
}

TEST_F(Stream, TheHandGoesToAPoseAndStays) {
  use("coglab/PoseStream");
  Pose goal = arm.hand();
  goal.position += Vector3(0.05, 0.1, 0.05);
  goal.orientation = expRotation(Vector3(0.0, 0.0, 0.4)) * goal.orientation;
  const Quaternion& q = goal.orientation;
  const Numbers command{
      goal.position.x(), goal.position.y(), goal.position.z(), q.x(), q.y(), q.z(), q.w()};
  double fastest = 0.0;
  for (int i = 0; i < 40; ++i) {
    follow(command);
    fastest = std::max(fastest, arm.handVelocity().norm());
  }
  EXPECT_LT((arm.hand().position - goal.position).norm(), 0.002);
  EXPECT_LT(rotationBetween(arm.hand().orientation, q).norm(), 0.01);
  EXPECT_GT(fastest, 0.2);
  EXPECT_LT(arm.handVelocity().norm(), 0.005);
}

TEST_F(Stream, RandomPosesKeepEveryLimit) {
  use("coglab/PoseStream");
  std::mt19937 random(3);
  std::uniform_real_distribution<double> draw(-2.0, 2.0);
  for (int command = 0; command < 60; ++command) {
    const Quaternion q = Quaternion(draw(random), draw(random), draw(random), 0.1).normalized();
    const Numbers pose{draw(random), draw(random), draw(random), q.x(), q.y(), q.z(), q.w()};
    for (int times = 0; times < 15; ++times) {
      ASSERT_TRUE(stream->send(pose).success) << arm.reason();
      for (int tick = 0; tick < 10; ++tick) {
        arm.tick();
        expectWithinLimits();
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST_F(Stream, InvalidPosesAreRefused) {
  use("coglab/PoseStream");
  const Answer answer = stream->send({0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0});
  EXPECT_EQ(answer.code, ReasonCode::InvalidArgument);
  EXPECT_NE(answer.message.find("quaternion"), std::string::npos) << answer.message;
}

TEST_F(Stream, OldCommandsAndThoseFromTheFutureAreRefused) {
  use("coglab/TwistStream");
  const Numbers up{0.0, 0.0, 0.1, 0.0, 0.0, 0.0};
  EXPECT_EQ(stream->send({up, 0.2, false}).code, ReasonCode::GoalStale);
  EXPECT_EQ(stream->send({up, std::nan(""), false}).code, ReasonCode::GoalStale);
  EXPECT_EQ(stream->send({up, -3.0, false}).code, ReasonCode::GoalFromFuture);
  // One that is valid counts until it is too old by its stamp, not by its arrival.
  ASSERT_TRUE(stream->send({up, 0.09, false}).success);
  arm.run(0.03);
  EXPECT_EQ(arm.state(), MotionState::Holding);
}

TEST_F(Stream, AtOneHertzTheArmBrakesBetweenTwoCommands) {
  use("coglab/TwistStream");
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(stream->send({0.0, 0.0, 0.1, 0.0, 0.0, 0.0}).success);
    arm.run(1.0);
    EXPECT_TRUE(arm.manager->report().standing);
  }
}

TEST_F(Stream, AtTwoKilohertzTheNewestCommandOfACycleCounts) {
  use("coglab/TwistStream");
  for (int cycle = 0; cycle < 200; ++cycle) {
    for (int i = 0; i < 9; ++i) ASSERT_TRUE(stream->send({1.0, 1.0, 1.0, 1.0, 1.0, 1.0}).success);
    ASSERT_TRUE(stream->send({0.0, 0.0, 0.1, 0.0, 0.0, 0.0}).success);
    arm.tick();
  }
  EXPECT_NEAR(arm.handVelocity().z(), 0.1, 0.01);
  EXPECT_NEAR(arm.handVelocity().head<2>().norm(), 0.0, 0.01);
}

TEST_F(Stream, JointsFollowTheirVelocities) {
  use("coglab/JointVelocityStream");
  const JointVector home = arm.sample.position;
  for (int i = 0; i < 20; ++i) follow({0.2, -0.1, 0.0, 0.1, 0.0, 0.0, 0.3});
  const JointVector way = arm.sample.position - home;
  EXPECT_NEAR(way[0], 0.2, 0.02);
  EXPECT_NEAR(way[1], -0.1, 0.01);
  EXPECT_NEAR(way[2], 0.0, 1e-3);
  EXPECT_NEAR(way[6], 0.3, 0.03);
}

TEST_F(Stream, OnSilenceTheArmStandsAndTheStreamStaysOpen) {
  use("coglab/TwistStream");
  for (int i = 0; i < 10; ++i) follow({0.0, 0.0, 0.2, 0.0, 0.0, 0.0});
  EXPECT_GT(arm.handVelocity().norm(), 0.15);
  arm.run(0.6);
  EXPECT_TRUE(arm.manager->report().standing);
  EXPECT_EQ(arm.state(), MotionState::Holding);
  EXPECT_EQ(arm.manager->report().reason.code(), ReasonCode::GoalStale);
  EXPECT_TRUE(stream->isOpen());
  const Pose there = arm.hand();
  arm.run(0.5);
  EXPECT_LT((arm.hand().position - there.position).norm(), 1e-9);
  // The next command goes on from there, without a step.
  double fastest = 0.0;
  for (int i = 0; i < 10; ++i) {
    follow({0.0, 0.0, -0.1, 0.0, 0.0, 0.0});
    fastest = std::max(fastest, arm.handVelocity().norm());
  }
  EXPECT_LT(fastest, 0.12);
  EXPECT_NEAR(arm.hand().position.z() - there.position.z(), -0.05, 0.006);
}

TEST_F(Stream, HugeTwistsKeepEveryLimit) {
  use("coglab/TwistStream");
  expectLimitsKept(1e9, 6);
}

TEST_F(Stream, HugeJointVelocitiesKeepEveryLimit) {
  use("coglab/JointVelocityStream");
  expectLimitsKept(1e9, 7);
}

TEST_F(Stream, AJointAtItsStopLeavesTheOthersFree) {
  use("coglab/JointVelocityStream");
  const double from = arm.sample.position[6];
  for (int i = 0; i < 60; ++i) follow({0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0});
  const double stop = arm.sample.position[5];
  EXPECT_GT(stop, arm.limits.upper_position[5] - 0.05);
  for (int i = 0; i < 20; ++i) follow({0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -0.3});
  EXPECT_NEAR(arm.sample.position[6] - from, -0.3, 0.03);
  for (int i = 0; i < 20; ++i) follow({0.0, 0.0, 0.0, 0.0, 0.0, -0.3, 0.0});
  EXPECT_NEAR(arm.sample.position[5] - stop, -0.3, 0.05);
}

TEST(StreamGains, TheGainOfTheRotationIsThatOfTheAxisToo) {
  VirtualArm arm{DESCRIPTION_DIR, "plugin_paths: [" PLUGIN_DIR
                                  "]\nstream: {second_task: axis, axis: [0, 0, 1], "
                                  "rot_clik_gain: 0}"};
  std::string active;
  ASSERT_TRUE(arm.manager->load("stream", "coglab/PoseStream").success);
  ASSERT_TRUE(arm.manager->switchTo("stream", active).success);
  auto& stream = dynamic_cast<StreamController&>(*arm.manager->motion("stream"));
  ASSERT_TRUE(stream.open().success);
  const Pose home = arm.hand();
  const Quaternion& q = home.orientation;
  const auto tilt = [&] {
    for (int i = 0; i < 20; ++i) {
      const Vector3& p = home.position;
      EXPECT_TRUE(stream.send({p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}).success);
      arm.run(0.05);
    }
    const Vector3 axis = arm.hand().orientation * Vector3::UnitZ();
    return std::acos(std::min(1.0, axis.dot(home.orientation * Vector3::UnitZ())));
  };
  tilt();
  arm.sample.position[5] += 0.1;  // a person pushes the hand
  arm.sample.commanded_position = arm.sample.position;
  EXPECT_GT(tilt(), 0.05);
  ASSERT_TRUE(stream.tunables()->set({{"rot_clik_gain", 10.0}}).success);
  EXPECT_LT(tilt(), 0.01);
}

TEST_F(Stream, InvalidCommandsAreRefusedAndTheArmContinues) {
  use("coglab/TwistStream");
  follow({0.0, 0.0, 0.1, 0.0, 0.0, 0.0});
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    const Answer answer = stream->send({0.0, 0.0, bad, 0.0, 0.0, 0.0});
    EXPECT_EQ(answer.code, ReasonCode::InvalidArgument);
    EXPECT_NE(answer.message.find("vz"), std::string::npos) << answer.message;
  }
  const Answer size = stream->send(Numbers(7, 0.0));
  EXPECT_NE(size.message.find("has 7 numbers; expected 6"), std::string::npos) << size.message;
  arm.run(0.02);
  EXPECT_GT(arm.handVelocity().z(), 0.0);
}

TEST_F(Stream, ACancelClosesItUntilItIsReopened) {
  use("coglab/TwistStream");
  for (int i = 0; i < 5; ++i) follow({0.0, 0.0, 0.1, 0.0, 0.0, 0.0});
  arm.manager->askCancel("stream", "enough");
  arm.tick();
  const Answer closed = stream->send({0.0, 0.0, 0.1, 0.0, 0.0, 0.0});
  EXPECT_EQ(closed.code, ReasonCode::NotActive);
  EXPECT_EQ(arm.state(), MotionState::Aborted);
  arm.run(0.5);
  EXPECT_TRUE(arm.manager->report().standing);
  ASSERT_TRUE(stream->open().success);
  arm.run(0.1);
  EXPECT_TRUE(arm.manager->report().standing) << "commands from before do not count";
  for (int i = 0; i < 5; ++i) follow({0.0, 0.0, 0.1, 0.0, 0.0, 0.0});
  EXPECT_GT(arm.handVelocity().z(), 0.08);
}

TEST_F(Stream, TakesOverFromAnotherMotionAndGivesWayToIt) {
  std::string active;
  ASSERT_TRUE(arm.manager->load("ptp", "coglab/PtpController").success);
  ASSERT_TRUE(arm.manager->switchTo("ptp", active).success);
  auto& ptp = dynamic_cast<PtpController&>(*arm.manager->motion("ptp"));
  JointVector to = arm.sample.position;
  to[0] += 1.0;
  const Numbers target(to.data(), to.data() + 7);
  ASSERT_TRUE(ptp.add({target, {}, {}}).success);
  arm.run(0.5);
  ASSERT_GT(arm.sample.velocity.norm(), 0.1);
  use("coglab/TwistStream");
  for (int i = 0; i < 10; ++i) follow({0.0, 0.0, 0.1, 0.0, 0.0, 0.0});
  EXPECT_NEAR(arm.handVelocity().z(), 0.1, 0.01);
  EXPECT_NEAR(arm.handVelocity().head<2>().norm(), 0.0, 0.01);
  ASSERT_TRUE(arm.manager->switchTo("ptp", active).success);
  EXPECT_FALSE(stream->isOpen());
  ASSERT_TRUE(ptp.add({target, {}, {}}).success);
  for (int i = 0; i < 2000 && arm.state() != MotionState::Reached; ++i) {
    arm.tick();
    expectWithinLimits();
  }
  EXPECT_NEAR(arm.sample.position[0], to[0], 0.003);
}

}  // namespace
}  // namespace coglab_controllers
