// Goals of the DMP plug-in in virtual time: they move, jump, vanish, turn and leave the workspace.
#include "virtual_robot.hpp"

#include <algorithm>
#include <functional>
#include <utility>

namespace coglab_controllers {
namespace {

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

/// Largest overshoot of the hand, m. The frame corrects its goal late and in small steps, by 30 mm
/// in total.
double wentBack(const std::string& frame) {
  VirtualRobot robot("dmp: {predicted_goals: _ahead}");
  robot.loadBoth();
  robot.see(frame, kGoal);
  DmpRequest request = robot.reach();
  request.goal_frame = frame;
  EXPECT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  double farthest = -1.0, back = 0.0;
  for (int i = 0; i < 1200; ++i) {
    const double told = std::clamp((i * 0.005 - 0.9) * 0.07, 0.0, 0.03);
    robot.see(frame, kGoal + Vector3(told, 0, 0));
    robot.tick();
    farthest = std::max(farthest, robot.hand().position.x());
    back = std::max(back, farthest - robot.hand().position.x());
  }
  EXPECT_EQ(robot.state(), MotionState::Reached);
  EXPECT_NEAR(robot.hand().position.x(), kGoal.x() + 0.03, 2e-3);
  return back;
}

TEST(DmpController, APredictedGoalGivesNoGoalVelocity) {
  const double seen = wentBack("human_hand"), predicted = wentBack("human_hand_ahead");
  EXPECT_GT(seen, predicted + 0.001);
  EXPECT_LT(predicted, 0.002);
  EXPECT_LT(wentBack("_ahead"), 0.002) << "the end may be all of the name";
  EXPECT_GT(wentBack("hand_ahead_of_us"), predicted + 0.001) << "but has to be its end";
}

/// A reach toward a goal that moves by `way(t)` from kGoal, 0.5 s after the start. Returns the
/// reason of its end and the largest distance of the goal from kGoal until then.
std::pair<ReasonCode, double> reachAfter(const GoalBounds& limits,
                                         const std::function<Vector3(double)>& way) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  DmpRequest request = robot.reach();
  request.goal_limits = limits;
  request.dmp_ratio = 2.0;
  EXPECT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  double largest = 0.0;
  for (int i = 0; i < 1200; ++i) {
    const Vector3 moved = way(std::max(0.0, i * 0.005 - 0.5));
    robot.see("human_hand", kGoal + moved);
    robot.tick();
    if (robot.state() == MotionState::Aborted) break;
    largest = std::max(largest, moved.norm());
  }
  return {robot.manager->report().reason.code(), largest};
}

TEST(DmpController, AGoalThatRetreatsLeavesOrFallsEndsTheMotion) {
  const GoalBounds limits{Vector3(0.5, -0.3, 0.1), Vector3(0.9, 0.3, 0.8), 0.10, 0.08};
  const auto back = [](double t) { return Vector3(0.3 * std::min(t, 1.0), 0, 0); };
  const auto aside = [](double t) { return Vector3(0, 0.5 * std::min(t, 1.0), 0); };
  const auto fall = [](double t) { return Vector3(0, 0, -4.905 * std::min(t * t, 0.2)); };
  const auto lowered = [](double t) { return Vector3(0, 0, -0.4 * std::min(t, 0.5)); };
  const auto sway = [](double t) { return 0.04 * Vector3(std::sin(t), std::cos(3 * t), 0); };
  const GoalBounds only_back{Vector3::Zero(), Vector3::Zero(), 0.10, 0};
  const auto [withdrawn, retreat] = reachAfter(only_back, back);
  EXPECT_EQ(withdrawn, ReasonCode::GoalWithdrawn);
  EXPECT_LT(retreat, 0.125);
  const auto [left, distance] = reachAfter({limits.region_low, limits.region_high, 0, 0}, aside);
  EXPECT_EQ(left, ReasonCode::GoalLeftRegion);
  EXPECT_LT(distance, 0.33);
  const GoalBounds only_down{Vector3::Zero(), Vector3::Zero(), 0, 0.08};
  const auto [fell, depth] = reachAfter(only_down, fall);
  EXPECT_EQ(fell, ReasonCode::GoalFell);
  EXPECT_LT(depth, 0.16);
  EXPECT_EQ(reachAfter(only_down, lowered).first, ReasonCode::None);
  EXPECT_EQ(reachAfter(limits, sway).first, ReasonCode::None);
  // Without limits it is followed, and as far as the arm reaches.
  const auto little = [](double t) { return Vector3(0.11 * std::min(t, 1.0), 0, 0); };
  EXPECT_EQ(reachAfter({}, little).first, ReasonCode::None);
  const auto [stretched, far] = reachAfter({}, back);
  EXPECT_EQ(stretched, ReasonCode::WorkspaceBorder);
  EXPECT_NEAR(far, 0.3, 1e-9);
}

TEST(DmpController, AGoalThatStartsOutsideItsRegionIsAllowed) {
  const GoalBounds far{Vector3(0.5, 0.1, 0.1), Vector3(0.9, 0.5, 0.8), 0, 0};
  EXPECT_EQ(reachAfter(far, [](double) { return Vector3::Zero(); }).first, ReasonCode::None);
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

/// A reach with a stopped clock toward a goal that was observed at its start, and later not at all
/// or with a stamp 0.2 s ahead of the clock.
struct Unseen : VirtualRobot {
  explicit Unseen(const std::string& parameters = "") : VirtualRobot(parameters) {
    loadBoth();
    EXPECT_TRUE(manager->setSpeedScale(0.0).success);
    for (int i = 0; i < 100; ++i) tick();
  }
  void begin(const Vector3& goal) {
    see("human_hand", goal);
    ASSERT_TRUE(ok(dmp().execute(reach())));
  }
  void wait(int cycles, bool ahead = false) {
    for (int i = 0; i < cycles; ++i) {
      if (ahead) {
        see("human_hand", kGoal);
        frames.frames["human_hand"].stamp_ns += 205'000'000;  // the next cycle is 5 ms later
        frames.frames["human_hand"].frame_ns += 205'000'000;
      }
      tick();
    }
  }
};

TEST(DmpController, ReasonsMentionTheClockOnlyIfItIsTheCause) {
  for (const bool ahead : {false, true}) {
    Unseen robot;
    robot.begin(kGoal);
    robot.wait(39, ahead);
    EXPECT_EQ(robot.reason(), "");
    robot.wait(2, ahead);
    const auto named = [&] { return robot.reason().find("clock") != std::string::npos; };
    EXPECT_EQ(named(), ahead) << robot.reason();
    EXPECT_EQ(robot.state(), MotionState::Holding);
    EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::GoalStale);
    robot.wait(158, ahead);
    EXPECT_EQ(robot.state(), MotionState::Holding);
    robot.wait(2, ahead);
    EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::GoalLost);
    EXPECT_EQ(named(), ahead) << robot.reason();
    EXPECT_EQ(robot.state(), MotionState::Aborted);
  }
}

/// If a busy computer slows the simulated cell down, a goal is lost after a second of the arm's
/// time.
TEST(DmpController, AGoalIsLostByTheTimeOfTheArm) {
  Unseen robot;
  robot.begin(kGoal);
  const auto halfSpeed = [&](int cycles) {
    for (int i = 0; i < cycles; ++i) {
      robot.now_ns += 5 * kMs;  // 10 ms pass on the computer, 5 ms in the cell
      robot.tick();
    }
  };
  halfSpeed(39);
  EXPECT_EQ(robot.reason(), "");
  halfSpeed(3);
  EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::GoalStale);
  halfSpeed(155);
  EXPECT_EQ(robot.state(), MotionState::Holding) << robot.reason();
  halfSpeed(5);
  EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::GoalLost);
}

}  // namespace
}  // namespace coglab_controllers
