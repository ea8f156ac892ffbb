// The shipped example of a motion of one's own, as an author would test it.
#include <gtest/gtest.h>

#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {
namespace {

struct Circle : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "], circle: {radius: 0.04}}"};
  AuthoredController& motion = arm.load("circle", "coglab_example_motions/Circle");

  void SetUp() override { arm.followWithinLimits(); }

  bool runToTheEnd(int cycles = 3000) {
    for (int i = 0; i < cycles && arm.state() != MotionState::Reached; ++i) arm.tick();
    return arm.state() == MotionState::Reached;
  }
};

TEST_F(Circle, DrawsItsCircleAndComesBack) {
  const Pose home = arm.hand();
  ASSERT_TRUE(motion.startMotion({{"radius", "duration"}, {0.06, 4.0}}).success);
  double furthest = 0.0, off = 0.0;
  while (arm.state() == MotionState::Running) {
    arm.tick();
    const Vector3 way = home.orientation.conjugate() * (arm.hand().position - home.position);
    furthest = std::max(furthest, way.norm());
    off = std::max(off, std::abs((way - Vector3(0.0, 0.0, 0.06)).norm() - 0.06));
  }
  EXPECT_EQ(arm.state(), MotionState::Reached) << arm.reason();
  EXPECT_NEAR(furthest, 0.12, 2e-3);
  EXPECT_LT(off, 2e-3);
  arm.run(1.0);
  EXPECT_LT((arm.hand().position - home.position).norm(), 2e-3);
  EXPECT_TRUE(arm.manager->report().standing);
}

TEST_F(Circle, AnArgumentHasItsDefaultFromTheParameters) {
  const Pose home = arm.hand();
  ASSERT_TRUE(motion.startMotion({}).success);
  double furthest = 0.0;
  while (arm.state() == MotionState::Running) {
    arm.tick();
    furthest = std::max(furthest, (arm.hand().position - home.position).norm());
  }
  EXPECT_NEAR(furthest, 0.08, 2e-3);
  EXPECT_NE(motion.describeArguments().find("radius: 0.04 m, 0 to 0.15"), std::string::npos)
      << motion.describeArguments();
}

TEST_F(Circle, HalfTheSpeedIsTwiceTheTimeOnTheSamePath) {
  ASSERT_TRUE(arm.manager->setSpeedScale(0.5).success);
  arm.run(1.0);
  const Pose home = arm.hand();
  ASSERT_TRUE(motion.startMotion({{"duration"}, {2.0}}).success);
  const std::int64_t begin = arm.now_ns;
  double off = 0.0;
  while (arm.state() == MotionState::Running) {
    arm.tick();
    const Vector3 way = home.orientation.conjugate() * (arm.hand().position - home.position);
    off = std::max(off, std::abs((way - Vector3(0.0, 0.0, 0.04)).norm() - 0.04));
  }
  EXPECT_EQ(arm.state(), MotionState::Reached) << arm.reason();
  EXPECT_NEAR(1e-9 * static_cast<double>(arm.now_ns - begin), 4.0, 0.2);
  EXPECT_LT(off, 2e-3);
}

TEST_F(Circle, BadRequestsAreRefusedWithTheirCode) {
  const auto code = [this](const MotionRequestByName& request) {
    const MotionAnswer answer = motion.startMotion(request);
    EXPECT_EQ(answer.status, MotionAnswer::kRejected);
    EXPECT_EQ(answer.id, -1);
    EXPECT_FALSE(answer.success);
    EXPECT_FALSE(answer.message.empty());
    return answer.code;
  };
  EXPECT_EQ(code({{"radius"}, {0.5}}), ReasonCode::OutOfRange);
  EXPECT_EQ(code({{"radius"}, {std::nan("")}}), ReasonCode::InvalidArgument);
  EXPECT_EQ(code({{"radius"}, {}}), ReasonCode::InvalidArgument);
  EXPECT_EQ(code({{"height"}, {0.1}}), ReasonCode::UnknownName);
  arm.sample.block = MotionBlock::Held;
  ++arm.sample.motion_epoch;
  arm.tick();
  EXPECT_EQ(code({}), ReasonCode::Held);
}

TEST_F(Circle, ABadParameterRefusesTheController) {
  VirtualArm other(DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "], circle: {radius: 7}}");
  const Answer answer = other.manager->load("circle", "coglab_example_motions/Circle");
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("circle/radius"), std::string::npos) << answer.message;
}

TEST_F(Circle, ARefusalSaysWhatWasExpectedAndLeavesNoTrace) {
  EXPECT_EQ(motion.startMotion({{"radius"}, {0.5}}).message, "radius is 0.5 m; expected 0 to 0.15");
  EXPECT_EQ(motion.startMotion({{"radius"}, {}}).message,
            "start_motion has 1 names and 0 values; expected one value for each name");
  EXPECT_EQ(motion.startMotion({{"height"}, {0.1}}).message,
            "'height' is no argument of this motion; there are:\n" + motion.describeArguments());
  arm.run(0.05);
  EXPECT_EQ(arm.state(), MotionState::Idle);
  EndedMotion end;
  EXPECT_FALSE(motion.readEnd(end));
  EXPECT_EQ(motion.startMotion({}).id, 0);
}

TEST(VirtualArm, FollowsAtOnceAndStandsWhereItMayNotMove) {
  VirtualArm arm(DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "]}");
  EXPECT_THROW(arm.load("nothing", "nowhere/Nothing"), std::runtime_error);
  AuthoredController& motion = arm.load("circle", "coglab_example_motions/Circle");
  const std::int64_t begin = arm.now_ns;
  const auto sequence = arm.sample.sequence;
  arm.run(0.05);
  EXPECT_EQ(arm.now_ns - begin, 50'000'000);
  EXPECT_EQ(arm.sample.sequence, sequence + 10);
  EXPECT_EQ(arm.sample.stamp_ns, arm.now_ns);
  EXPECT_EQ(arm.sample.position, JointVector(kHome));
  EXPECT_EQ(arm.sample.cycle_time, 0.005);
  EXPECT_EQ(arm.sample.stop_delay, coglab_rt::lostTime(0.005));
  EXPECT_EQ(arm.sample.stop_rounding, 2.0 * coglab_rt::kWireRounding);
  ASSERT_TRUE(motion.startMotion({}).success);
  arm.run(1.0);
  const RobotSample before = arm.sample;
  const Vector3 hand = arm.hand().position;
  const JointVector velocity = arm.tick().velocity;
  EXPECT_GT(velocity.norm(), 1e-3);
  EXPECT_LT((arm.sample.position - before.position - 0.005 * velocity).norm(), 1e-15);
  EXPECT_EQ(arm.sample.commanded_position, arm.sample.position);
  EXPECT_EQ(arm.sample.velocity, velocity);
  EXPECT_EQ(arm.sample.commanded_velocity, velocity);
  const JointVector acceleration = (velocity - before.commanded_velocity) / 0.005;
  EXPECT_LT((arm.sample.commanded_acceleration - acceleration).norm(), 1e-9);
  EXPECT_LT((arm.handVelocity() - (arm.hand().position - hand) / 0.005).norm(), 1e-3);
  arm.sample.block = MotionBlock::Held;
  ++arm.sample.motion_epoch;
  const JointVector held = arm.sample.position;
  EXPECT_TRUE(arm.tick().velocity.isZero(0.0));
  EXPECT_EQ(arm.sample.position, held);
}

TEST(CopyOnRequest, IsMadeOncePerRequestAndReadOnce) {
  CopyOnRequest<int> copies;
  int made = 0, read = -1;
  const auto give = [&] { copies.give([&made] { return ++made; }); };
  give();
  EXPECT_EQ(made, 0);
  EXPECT_FALSE(copies.read(read));
  copies.ask();
  copies.ask();
  give();
  give();
  EXPECT_EQ(made, 1);
  EXPECT_TRUE(copies.read(read));
  EXPECT_EQ(read, 1);
  EXPECT_FALSE(copies.read(read));
}

}  // namespace
}  // namespace coglab_controllers
