// Goals of the DMP plug-in in virtual time: they move, jump, vanish, turn and leave the workspace.
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const Vector3 kGoal(0.80, 0.0, 0.45);

TEST(DmpController, FollowsAgainOnlyWhenTheGoalLeavesItsBall) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 800; ++i) {
    robot.see("human_hand", kGoal);
    robot.tick();
  }
  ASSERT_EQ(robot.state(), MotionState::Reached);
  for (int i = 0; i < 200; ++i) {  // 20 mm away, and noise: nothing moves
    robot.see("human_hand", kGoal + Vector3(0.0, 0.02 + 0.004 * std::sin(i), 0.0));
    robot.tick();
    ASSERT_EQ(robot.command.velocity, JointVector::Zero().eval());
  }
  const Vector3 moved = kGoal + Vector3(0.0, 0.08, 0.0);
  bool ran = false;
  for (int i = 0; i < 1000; ++i) {
    robot.see("human_hand", moved);
    robot.tick();
    ran = ran || robot.state() == MotionState::Running;
  }
  EXPECT_TRUE(ran);
  EXPECT_EQ(robot.state(), MotionState::Reached);
  EXPECT_LT((robot.hand().position - moved).norm(), 2e-3);
}

TEST(DmpController, OldGoalIsHeldAndALostOneAborts) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  DmpRequest request = robot.reach();
  request.dmp_ratio = 4.0;
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  for (int i = 0; i < 60; ++i) robot.tick();  // 0.3 s without a frame
  EXPECT_EQ(robot.state(), MotionState::Holding);
  EXPECT_NE(robot.reason().find("old"), std::string::npos) << robot.reason();
  robot.see("human_hand", kGoal);
  robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Running);
  for (int i = 0; i < 210; ++i) robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Aborted);
  EXPECT_NE(robot.reason().find("lost"), std::string::npos) << robot.reason();
}

TEST(DmpController, LostGoalNearTheEndIsFinished) {
  VirtualRobot robot;
  robot.loadBoth();
  const Vector3 near = robot.hand().position + Vector3(0.06, 0.0, 0.0);
  robot.see("human_hand", near);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 1000; ++i) robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - near).norm(), 2e-3);
}

TEST(DmpController, JumpIsBelievedAfterThreeFrames) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  robot.tick();
  const Vector3 far = kGoal + Vector3(0.0, -0.2, 0.0);
  for (int frame = 0; frame < 2; ++frame) {
    robot.see("human_hand", far);
    robot.tick();
    EXPECT_EQ(robot.state(), MotionState::Holding);
    EXPECT_NE(robot.reason().find("jumped"), std::string::npos);
  }
  robot.see("human_hand", far);
  robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Running);
  robot.see("human_hand", kGoal);  // one wild frame, then the old place again
  robot.tick();
  robot.see("human_hand", far);
  robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Running);
}

TEST(DmpController, TopicGoalMayBeReplacedByAFarOne) {
  VirtualRobot robot;
  robot.loadBoth();
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().setGoal("lwr_base_link", kGoal, 0)));
  DmpRequest request = robot.reach();
  request.goal_frame.clear();
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  for (int i = 0; i < 50; ++i) robot.tick();
  const Vector3 far = kGoal + Vector3(-0.05, -0.25, 0.05);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().setGoal("lwr_base_link", far, 0)));
  for (int i = 0; i < 1000; ++i) robot.tick();  // stays valid until replaced
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - far).norm(), 2e-3);
}

TEST(DmpController, GoalThatLeavesTheWorkspaceIsProjected) {
  VirtualRobot robot("workspace: {box_max: [0.75, 1.2, 1.6]}");
  robot.loadBoth();
  robot.see("human_hand", kGoal);  // 50 mm outside, within goal_reach_margin
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 1000; ++i) {
    robot.see("human_hand", kGoal);
    robot.tick();
    ASSERT_LT(robot.hand().position.x(), 0.7505);
    if (i == 100) {
      EXPECT_NE(robot.reason().find("outside the workspace"), std::string::npos);
    }
  }
  EXPECT_GT(robot.hand().position.x(), 0.74);
}

TEST(DmpController, FollowsATurningObject) {
  VirtualRobot robot;
  robot.loadBoth();
  const Quaternion start = robot.hand().orientation;
  robot.see("human_hand", kGoal);
  DmpRequest request = robot.reach();
  request.orientation_control = true;
  request.target_orientation = start.coeffs();
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  Quaternion object = Quaternion::Identity();
  for (int i = 0; i < 1000; ++i) {
    const double angle = std::min(0.3, 0.3 * i * robot.period / 0.8);  // turns for 0.8 s
    object = Quaternion(Eigen::AngleAxisd(angle, Vector3::UnitZ()));
    robot.see("human_hand", kGoal, object);
    robot.tick();
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT(robot.hand().orientation.angularDistance(object * start), 0.02);
}

}  // namespace
}  // namespace coglab_controllers
