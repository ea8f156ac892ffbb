// Motions that a joint's stop or a border of the workspace blocks. They end by themselves, and the
// reason contains the limit.
#include <random>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

/// Ticks until the motion is over, at most so many seconds. @return s that the hand stood at last
double follow(VirtualRobot& robot, const Vector3& goal, double limit) {
  Vector3 there = robot.hand().position;
  double stood = 0.0;
  for (double t = 0.0; t < limit; t += robot.period) {
    robot.see("human_hand", goal);
    robot.tick();
    if (robot.state() != MotionState::Running) break;
    stood += robot.period;
    if ((robot.hand().position - there).norm() > 2e-3) {
      there = robot.hand().position;
      stood = 0.0;
    }
  }
  return stood;
}

class Reaches : public ::testing::TestWithParam<int> {};

TEST_P(Reaches, EndByThemselvesWithTheBlockingLimit) {
  const char* primitives[] = {"reach_human", "reach_human_high", "give_human", "take_board",
                              "put_board"};
  std::mt19937 random(static_cast<unsigned>(GetParam()));
  std::uniform_real_distribution<double> place(-0.9, 0.9);
  int reached = 0, blocked = 0, refused = 0;
  for (int i = 0; i < 30; ++i) {
    VirtualRobot robot;
    robot.loadBoth();
    Vector3 goal;
    do {
      goal = Vector3(place(random), place(random), 0.6 + place(random));
    } while (!robot.manager->settings().robot->workspace.contains(goal));
    robot.see("human_hand", goal);
    const Answer answer = robot.dmp().execute(robot.reach(primitives[i % 5]));
    if (!answer.success) {
      EXPECT_EQ(answer.code, ReasonCode::WorkspaceBorder) << answer.message;
      ++refused;
      continue;
    }
    const double stood = follow(robot, goal, 8.0);
    ASSERT_LT(stood, 2.2) << i;  // settle_time, at the goal
    if (robot.state() == MotionState::Reached) {
      ++reached;
      EXPECT_LT((robot.hand().position - goal).norm(), 0.011) << i;
      continue;
    }
    ++blocked;
    ASSERT_EQ(robot.state(), MotionState::Aborted) << i << " at " << goal.transpose();
    const ReasonCode code = robot.manager->report().reason.code();
    if (code == ReasonCode::TargetNotReached) continue;
    EXPECT_LT(stood, 0.9) << i;  // it may have crept a little
    EXPECT_TRUE(code == ReasonCode::JointBlocked || code == ReasonCode::WorkspaceBorder)
        << robot.reason();
  }
  EXPECT_GT(reached, 2);
  EXPECT_GT(blocked, 2);
  EXPECT_GT(refused, 0);
}
INSTANTIATE_TEST_SUITE_P(Seeds, Reaches, ::testing::Range(1, 5));

TEST(BlockedMotion, APathThatLeavesTheWorkspaceIsRefusedBeforeTheArmMoves) {
  VirtualRobot robot;
  robot.loadBoth();
  const Vector3 behind(-0.55, -0.1, 0.25);  // the straight way leads through the base
  robot.see("human_hand", behind);
  PredictedPath path;
  EXPECT_EQ(robot.dmp().execute(robot.reach()).code, ReasonCode::WorkspaceBorder);
  EXPECT_EQ(robot.dmp().predict(robot.reach(), path).code, ReasonCode::WorkspaceBorder);
  robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Idle);
}

/// A goal on the border or just beyond it is approached: the path ends there.
TEST(BlockedMotion, AGoalAtTheBorderIsReached) {
  for (const double outside : {0.0, 0.1}) {
    VirtualRobot robot("workspace: {box_max: [0.75, 1.2, 1.6]}");
    robot.loadBoth();
    const Vector3 goal(0.75 + outside, 0.0, 0.5);
    robot.see("human_hand", goal);
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    follow(robot, goal, 8.0);
    EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
    EXPECT_NEAR(robot.hand().position.x(), 0.75, 0.011);
  }
}

/// A slow or paused motion, or one along a border, is not blocked while it makes progress.
TEST(BlockedMotion, ASlowOrPausedMotionIsNotOne) {
  VirtualRobot robot("workspace: {box_max: [0.755, 1.2, 1.6]}");
  robot.loadBoth();
  const Vector3 goal(0.75, 0.0, 0.5);
  robot.see("human_hand", goal);
  ASSERT_TRUE(robot.manager->setSpeedScale(0.05).success);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  follow(robot, goal, 3.0);
  for (const double scale : {0.0, 0.05, 0.0, 1.0}) {
    ASSERT_TRUE(robot.manager->setSpeedScale(scale).success);
    follow(robot, goal, 3.0);
    if (scale < 1.0) ASSERT_EQ(robot.state(), MotionState::Running) << robot.reason();
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
}

/// The arm is fully stretched when the goal moves to the hand. This ends the motion.
TEST(BlockedMotion, SucceedsIfTheGoalMovesToTheHand) {
  VirtualRobot robot;
  robot.loadBoth();
  Vector3 goal(0.21, 0.61, 0.92);
  robot.see("human_hand", goal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach("take_board"))));
  double stood = 0.0;
  for (int i = 0; i < 1000 && stood < 0.3; ++i) {
    robot.see("human_hand", goal);
    robot.tick();
    stood = robot.handVelocity().norm() < 1e-3 && i > 100 ? stood + robot.period : 0.0;
  }
  ASSERT_GE(stood, 0.3);
  ASSERT_EQ(robot.state(), MotionState::Running);
  ASSERT_EQ(robot.manager->report().guard.reason, GuardReason::WorkspaceBorder);
  const Vector3 stretched = robot.hand().position;
  for (double share = 0.1; share < 1.05; share += 0.1) {
    robot.see("human_hand", goal + share * (stretched - goal));
    for (int i = 0; i < 3; ++i) robot.tick();
  }
  goal = stretched;
  follow(robot, goal, 3.0);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - stretched).norm(), 0.011);
  // It is followed again when it goes on.
  goal = stretched - 0.1 * stretched.normalized();
  for (int i = 0; i < 100; ++i) {
    robot.see("human_hand", goal);
    robot.tick();
  }
  follow(robot, goal, 5.0);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - goal).norm(), 0.011);
}

TEST(BlockedMotion, AShapeIsNotScaledWithoutLimit) {
  VirtualRobot robot("dmp: {max_scale: 1.0}");
  robot.loadBoth();
  const Vector3 hand = robot.hand().position;
  for (const double away : {0.45, 0.55}) {  // 0.5 m were demonstrated
    robot.see("human_hand", hand + Vector3(0.0, away, 0.0));
    const Answer answer = robot.dmp().execute(robot.reach());
    EXPECT_EQ(answer.code, away < 0.5 ? ReasonCode::None : ReasonCode::OutOfRange)
        << answer.message;
  }
}

}  // namespace
}  // namespace coglab_controllers
