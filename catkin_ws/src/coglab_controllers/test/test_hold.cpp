// The hold cycle by cycle: joints that brake together, from which speed on, and when the arm
// stands.
#include <gtest/gtest.h>

#include <cmath>

#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_controllers/manager/robot_setup.hpp"
#include "coglab_controllers/motion/hold.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

/// A robot of which every joint brakes with at most 2 rad/s^2 and 20 rad/s^3: from a speed v of 0.2
/// rad/s or more it needs v / 2 + 0.1 s.
RobotSetup evenRobot() {
  const std::string description = DESCRIPTION_DIR;
  RobotSetup setup =
      *makeRobotSetup(readText(description + "/urdf/lwr_ih2.urdf"),
                      coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml"),
                      Parameters(YAML::Load("{}"), "manager"));
  setup.limits.acceleration.setConstant(2.0);
  setup.limits.jerk.setConstant(20.0);
  return setup;
}

JointVector joints(double a, double b, double c = 0.0, double d = 0.0, double e = 0.0) {
  JointVector values = JointVector::Zero();
  values.head<5>() << a, b, c, d, e;
  return values;
}

class HoldTest : public ::testing::Test {
 protected:
  void SetUp() override {
    input.robot.position = kHome;
    input.robot.commanded_position = kHome;
    input.dt = 0.005;
  }
  /// The joint velocity that the hold asks for while the arm is told to go on with this one.
  JointVector asked(const JointVector& velocity, const JointVector& acceleration = joints(0, 0)) {
    input.robot.commanded_velocity = velocity;
    input.robot.commanded_acceleration = acceleration;
    hold.computeReference(input, setup, stage.references());
    return stage.references().states.view(stage.references().joint_velocity);
  }
  void expectAsked(const JointVector& expected, const JointVector& velocity,
                   const JointVector& acceleration = joints(0, 0)) {
    const JointVector found = asked(velocity, acceleration);
    EXPECT_LT((found - expected).lpNorm<Eigen::Infinity>(), 1e-12) << found.transpose();
  }
  JointVector held() { return stage.references().states.view(stage.references().joint_position); }

  RobotSetup setup = evenRobot();
  ctrl_more::Logger logger;
  FeedbackStage stage{setup, 0.005, true, &logger};
  CycleInput input;
  Hold hold;
};

TEST_F(HoldTest, TheSlowestBrakesAsItCanAndTheOthersAreThreeCyclesAhead) {
  // They need 0.3, 0.2, 0.25, 0.235 and 0.2 s: the third one nearly as long as the first.
  const JointVector from = joints(0.4, 0.2, 0.3, 0.27, -0.2);
  const JointVector others = joints(0.0, 0.2, 0.0, 0.27, -0.2);
  hold.begin();
  expectAsked(others, from);
  expectAsked(others, 1.1 * from);
  expectAsked(0.6 * others, 0.9 * from);
  expectAsked(0.0 * others, 0.31 * from);
  expectAsked(0.31 * others, 0.31 * from);
  expectAsked(0.23 * others, 0.29 * from);
  expectAsked(0.0 * others, 0.29 * from);  // the slowest had less than 0.3 of its speed left
  hold.begin();
  expectAsked(others, from);
}

TEST_F(HoldTest, AJointThatStillSpeedsUpIsBrakedFirst) {
  const JointVector from = joints(0.4, -0.1);
  hold.begin();
  expectAsked(joints(0, 0), from, joints(0, -0.041));  // more than 0.02 of its limit
  expectAsked(joints(0, 0), from, joints(0.041, 0));
  expectAsked(joints(0, -0.1), from, joints(0, -0.039));
  expectAsked(joints(0, -0.1), from, joints(0, -0.041));  // only when it begins
  hold.begin();
  expectAsked(joints(0, -0.1), from, joints(-0.5, 0.5));  // these brake already
}

TEST_F(HoldTest, BelowTwentyMilliradiansPerSecondEachBrakesAsItCan) {
  hold.begin();
  expectAsked(joints(0, 0), joints(0.0199, 0.005));
  hold.begin();
  expectAsked(joints(0, 0.005), joints(0.0201, 0.005));
  hold.begin();
  expectAsked(joints(0, -0.005), joints(-0.0201, -0.005));
}

TEST_F(HoldTest, ItStandsBelowOneMilliradianPerSecondAndThenRemembers) {
  const JointVector second = kHome + joints(0.1, 0, -0.1), third = kHome + joints(0.2, 0);
  hold.begin();
  asked(joints(0, 0.00101));
  EXPECT_EQ(held(), JointVector(kHome));
  input.robot.commanded_position = second;
  asked(joints(0, -0.00101));
  EXPECT_EQ(held(), second);
  asked(joints(0, -0.00099));
  input.robot.commanded_position = third;
  expectAsked(joints(0, 0), joints(0.4, 0.2));  // whatever the arm does, it stands
  EXPECT_EQ(held(), second);
  const ChainState there = setup.chain.evaluate(second);
  const auto pose = stage.references().states.view(stage.references().pose);
  EXPECT_EQ(pose.head<3>(), there.tool.position);
  EXPECT_EQ(pose.tail<4>(), there.tool.orientation.coeffs());
  EXPECT_TRUE(stage.references().states.view(stage.references().twist).isZero(0.0));
  hold.begin();
  asked(joints(0, 0.5));
  EXPECT_EQ(held(), third);
}

TEST_F(HoldTest, OnlyAReferenceThatFeedbackMovedIsResolved) {
  hold.begin();
  asked(joints(0, 0));
  References& references = stage.references();
  int solved = 0;
  CartesianReference seen;
  const auto solve = [&](const ChainState&, const JointVector& from,
                         const CartesianReference& reference) {
    ++solved;
    seen = reference;
    EXPECT_EQ(from, JointVector(kHome));
    return joints(0.1, 0.2);
  };
  hold.resolve(input, references, solve);
  EXPECT_EQ(solved, 0);
  references.states.view(references.twist)[5] = 0.25;
  references.states.view(references.twist)[0] = 0.5;
  hold.resolve(input, references, solve);
  EXPECT_EQ(solved, 1);
  EXPECT_EQ(seen.velocity, Vector3(0.5, 0, 0));
  EXPECT_EQ(seen.angular_velocity, Vector3(0, 0, 0.25));
  EXPECT_EQ(JointVector(references.states.view(references.joint_velocity)), joints(0.1, 0.2));
  asked(joints(0, 0));
  references.states.view(references.pose) << 1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9;
  hold.resolve(input, references, solve);
  EXPECT_EQ(solved, 2);
  EXPECT_EQ(seen.pose.position, Vector3(1, 2, 3));
  EXPECT_EQ(seen.pose.orientation.coeffs(), Eigen::Vector4d(0.1, 0.2, 0.3, 0.9));
}

TEST(StartBlend, ADifferenceFadesByItsTimeConstantOrAtOnce) {
  StartBlend blend;
  blend.begin(Vector3(1, 2, 3), Vector3(4, 5, 6), joints(7, 8));
  blend.advance(0.15);
  const double left = std::exp(-1.0);
  EXPECT_TRUE(blend.position().isApprox(left * Vector3(1, 2, 3), 1e-12));
  EXPECT_TRUE(blend.rotation().isApprox(left * Vector3(4, 5, 6), 1e-12));
  EXPECT_TRUE(blend.joints().isApprox(left * joints(7, 8), 1e-12));
  blend.setTime(0.3);
  blend.advance(0.3);
  EXPECT_TRUE(blend.position().isApprox(left * left * Vector3(1, 2, 3), 1e-12));
  blend.setTime(0.0);
  blend.advance(0.001);
  EXPECT_TRUE(blend.position().isZero(0.0) && blend.rotation().isZero(0.0));
  EXPECT_TRUE(blend.joints().isZero(0.0));
}

}  // namespace
}  // namespace coglab_controllers
