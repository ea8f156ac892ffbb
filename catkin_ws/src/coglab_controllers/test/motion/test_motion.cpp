// The shipped example of a motion of one's own, as an author would test it.
#include <gtest/gtest.h>

#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {
namespace {

struct Circle : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "], circle: {radius: 0.04}}"};
  CustomMotionController& motion = arm.load("circle", "coglab_example_motions/Circle");

  void SetUp() override { arm.followWithinLimits(); }
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

}  // namespace
}  // namespace coglab_controllers
