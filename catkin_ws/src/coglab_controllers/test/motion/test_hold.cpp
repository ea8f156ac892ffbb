// The hold cycle by cycle: joints that brake together, their speeds, and standstill.
#include <gtest/gtest.h>

#include <cmath>

#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_controllers/manager/robot_setup.hpp"
#include "coglab_controllers/motion/hold.hpp"
#include "coglab_controllers/motion/reference_loop.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

/// A robot whose joints brake with at most 2 rad/s^2 and 20 rad/s^3. From a speed v >= 0.2 rad/s
/// this takes v / 2 + 0.1 s.
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
  /// The joint velocity that the hold requests at this commanded velocity.
  JointVector asked(const JointVector& velocity, const JointVector& acceleration = joints(0, 0)) {
    input.robot.commanded_velocity = velocity;
    input.robot.commanded_acceleration = acceleration;
    hold.computeReference(input, setup, {}, stage.references());
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

TEST_F(HoldTest, TheSlowestJointBrakesAloneAndTheOthersAreThreeCyclesAhead) {
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

TEST_F(HoldTest, BelowOneMilliradianPerSecondItLatchesThePosture) {
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

/// The control law around a motion's reference, cycle by cycle.
class LoopTest : public HoldTest {
 protected:
  void SetUp() override {
    HoldTest::SetUp();
    MotionSetup motion;
    motion.id = "loop";
    motion.parameters =
        YAML::Load("{Kp: 4, hold_blend: 0.3, tolerance: 0.004, arrive_distance: 0.02}");
    motion.robot = std::make_shared<RobotSetup>(setup);
    loop.configure(motion, ReferenceLoop::Spaces::Both, tunables);
    input.chain = setup.chain.evaluate(input.robot.position);
  }
  JointVector run(const MotionReference& reference) {
    loop.write(input, reference, stage.references());
    loop.resolve(input, stage.references());
    return stage.references().states.view(stage.references().joint_velocity);
  }
  const double gone = 1.0 - std::exp(-0.005 / 0.3);  // share of a difference that became an error
  Tunables tunables;
  ReferenceLoop loop;
};

TEST_F(LoopTest, JointsBeginWithoutAnErrorThatThenBlendsIn) {
  const JointVector away = joints(0.01, -0.02), speed = joints(0.1, 0);
  input.robot.position = kHome - away;
  MotionReference reference(0.005);
  reference.joints(kHome, kHome + 0.005 * speed);
  EXPECT_LT((run(reference) - speed).norm(), 1e-9);
  EXPECT_LT((run(reference) - speed - 4.0 * gone * away).norm(), 1e-9);
  reference.jumps = true;
  EXPECT_LT((run(reference) - speed).norm(), 1e-9);
  EXPECT_EQ(loop.ik().scale, 1.0);
  References& references = stage.references();
  EXPECT_TRUE(references.states.view(references.twist).isZero(0.0));
  EXPECT_EQ(references.states.view(references.pose).head<3>(), input.chain.tool.position);
  EXPECT_NEAR(loop.error(input), 0.02, 1e-12);
  EXPECT_EQ(loop.allowedError(), 0.004);
  EXPECT_EQ(loop.stuck(input).code(), ReasonCode::TargetNotReached);
  for (const auto& [scale, rate] : {std::pair(0.5, 0.5), {0.1, 0.1}, {0.02, 0.1}, {1.0, 1.0}}) {
    input.time_scale = scale;
    const SetPoint from = loop.setPoint(input, false), end = loop.setPoint(input, true);
    EXPECT_EQ(from.joints, reference.joint_next);
    EXPECT_LT((from.joint_velocity - speed / rate).norm(), 1e-9);
    const ChainState there = setup.chain.evaluate(from.joints);
    EXPECT_EQ(from.pose.position, there.tool.position);
    EXPECT_LT((from.velocity - there.jacobian.topRows<3>() * speed / rate).norm(), 1e-9);
    EXPECT_LT((from.angular_velocity - there.jacobian.bottomRows<3>() * speed / rate).norm(), 1e-9);
    EXPECT_EQ(end.joints, from.joints);
    EXPECT_TRUE(end.joint_velocity.isZero(0.0));
    EXPECT_TRUE(end.velocity.isZero(0.0) && end.angular_velocity.isZero(0.0));
  }
}

TEST_F(LoopTest, APoseBeginsWithoutAnErrorThatThenBlendsIn) {
  const Vector3 away(0.002, 0.0, -0.001), turned(0.0, 0.01, 0.02);
  const Pose& tool = input.chain.tool;
  CartesianReference to;
  to.pose = {tool.position + away, expRotation(turned) * tool.orientation};
  to.velocity = Vector3(0.02, 0.0, 0.01);
  to.angular_velocity = Vector3(0.0, 0.05, 0.0);
  MotionReference reference(0.005);
  reference.cartesian(to);
  run(reference);
  EXPECT_LT(loop.ik().position_error.norm() + loop.ik().rotation_error.norm(), 1e-9);
  reference.share = 0.5;
  const JointVector half = run(reference);
  EXPECT_EQ(half, (0.5 * loop.ik().velocity).eval());
  EXPECT_GT(half.norm(), 1e-3);
  EXPECT_LT((loop.ik().position_error - gone * away).norm(), 1e-9);
  EXPECT_LT((loop.ik().rotation_error - gone * turned).norm(), 1e-6);
  EXPECT_EQ(loop.error(input), loop.ik().position_error.norm());
  EXPECT_EQ(loop.allowedError(), 0.02);
  EXPECT_EQ(loop.stuck(input).str(), Arrival::handStuck(loop.error(input)).str());
  input.time_scale = 0.5;
  const SetPoint from = loop.setPoint(input, false), end = loop.setPoint(input, true);
  EXPECT_EQ(from.joints, input.robot.commanded_position);
  EXPECT_LT((from.pose.position - (to.pose.position + 0.005 * to.velocity)).norm(), 1e-12);
  EXPECT_LT((from.velocity - 2.0 * to.velocity).norm(), 1e-12);
  EXPECT_LT((from.angular_velocity - 2.0 * to.angular_velocity).norm(), 1e-12);
  EXPECT_TRUE(end.velocity.isZero(0.0) && end.angular_velocity.isZero(0.0));
  reference.jumps = true;
  run(reference);
  EXPECT_LT(loop.ik().position_error.norm() + loop.ik().rotation_error.norm(), 1e-9);
}

}  // namespace
}  // namespace coglab_controllers
