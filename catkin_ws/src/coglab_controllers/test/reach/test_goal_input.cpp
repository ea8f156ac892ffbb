// GoalInput alone, and the DMP plug-in's goals in a frame of its own: ages, stamps and owners at
// their limits, and poses that are right when dmp_frame_name is not the robot's base.
#include <cmath>

#include "coglab_controllers/goal/goal_input.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

constexpr std::int64_t kSecond = 1000 * kMs, kNow = 5000 * kMs;

/// A host that provides only the time.
class Clock : public MotionHost {
 public:
  MotionRequest beginRequest(const std::string&) override { return {}; }
  RobotSample robotSnapshot() const override { return {}; }
  std::int64_t now_ns() const override { return now; }
  std::function<void()> cycleWait() const override { return {}; }
  double planTimeout() const override { return 0.1; }
  std::string notAdopted(PlanOutcome) const override { return ""; }
  std::int64_t now = kNow;
};

/// Frames that also report the lead of their newest transform.
class Frames : public FrameTable {
 public:
  bool lookup(const std::string& reference, const std::string& frame, GoalObservation& observation,
              std::string& why) override {
    ++lookups;
    return FrameTable::lookup(reference, frame, observation, why);
  }
  double ahead(const std::string& frame) override { return frame == late_frame ? late : 0.0; }
  std::string late_frame;
  double late = 0.0;
  int lookups = 0;
};

struct Feed : ::testing::Test {
  Feed() {
    feed.configure("base", GoalFrameLimits(), clock);
    feed.setSource(&frames);
  }
  void see(const std::string& frame, std::int64_t stamp, std::int64_t frame_ns, double x = 0.5) {
    GoalObservation& seen = frames.frames[frame];
    seen.position = Vector3(x, 0.0, 0.0);
    seen.stamp_ns = stamp;
    seen.frame_ns = frame_ns;
  }
  Answer first(const std::string& frame) { return feed.first(frame, goal); }
  GoalObservation newest() {
    feed.read(goal);
    return goal;
  }

  Clock clock;
  Frames frames;
  GoalInput feed;
  GoalObservation goal;
};

TEST_F(Feed, AFrameIsAGoalUpToItsAgeAndAsFarAheadAsClocksDiffer) {
  for (const auto& [ahead, code] : {std::pair(-200 * kMs, ReasonCode::None),
                                    {-200 * kMs - kMs, ReasonCode::GoalStale},
                                    {50 * kMs, ReasonCode::None},
                                    {50 * kMs + kMs, ReasonCode::GoalFromFuture}}) {
    see("cup", kNow + ahead, 77);
    EXPECT_EQ(first("cup").code, code) << ahead;
  }
}

TEST_F(Feed, AMissingGoalIsReportedWithTheCause) {
  EXPECT_EQ(first("cup").code, ReasonCode::UnknownName);
  frames.late_frame = "cup";
  frames.late = 3.5;
  EXPECT_EQ(first("cup").code, ReasonCode::GoalFromFuture);
  EXPECT_EQ(first("").code, ReasonCode::GoalMissing);
  see("cup", kNow, 77);
  for (const Vector3& bad : {Vector3(std::nan(""), 0, 0), Vector3(0, INFINITY, 0)}) {
    frames.frames["cup"].position = bad;
    EXPECT_EQ(first("cup").code, ReasonCode::InvalidArgument);
  }
  see("cup", kNow, 77);
  frames.frames["cup"].orientation.coeffs() << 0, 0, 0, 1.1;
  EXPECT_EQ(first("cup").code, ReasonCode::InvalidArgument);
  feed.setSource(nullptr);
  EXPECT_EQ(first("cup").code, ReasonCode::GoalMissing);
  Pose pose;
  const Answer none = feed.transform("base", "cup", "dmp_frame_name", pose);
  EXPECT_EQ(none.code, ReasonCode::UnknownName);
  feed.poll();
}

TEST_F(Feed, GoalsOnTheTopicAreInTheFrameFiniteNewAndNotFromTheFuture) {
  const Vector3 place(0.5, 0.0, 0.5);
  EXPECT_EQ(feed.offer("world", place, 0, 0).code, ReasonCode::UnknownName);
  EXPECT_EQ(feed.offer("base", Vector3(0, 0, INFINITY), 0, 0).code, ReasonCode::InvalidArgument);
  EXPECT_EQ(feed.offer("base", place, kNow + 50 * kMs + 1, 9).code, ReasonCode::GoalFromFuture);
  EXPECT_NEAR(feed.ahead(), 0.05, 1e-8) << "the motion follows the topic";
  EXPECT_TRUE(feed.offer("base", place, kNow + 50 * kMs, 10).success);
  EXPECT_EQ(feed.ahead(), 0.0);
  EXPECT_EQ(feed.offer("base", place, kNow + 50 * kMs, 10).code, ReasonCode::TooLate);
  EXPECT_EQ(feed.offer("base", place, kNow, 9).code, ReasonCode::TooLate);
  EXPECT_TRUE(feed.offer("base", place, kNow, 11).success);
  ASSERT_TRUE(first("").success);
  EXPECT_EQ(goal.frame_ns, 11);
  EXPECT_EQ(goal.stamp_ns, kNow);
  EXPECT_EQ(goal.request, 1u);
  clock.now += kMs;  // without stamps: now, and the frame is that
  EXPECT_TRUE(feed.offer("base", place, 0, 0).success);
  ASSERT_TRUE(first("").success);
  EXPECT_EQ(goal.stamp_ns, kNow + kMs);
  EXPECT_EQ(goal.frame_ns, kNow + kMs);
}

TEST_F(Feed, AStepBackOfTheTopicsClockIsOneOfMoreThanClocksDiffer) {
  const Vector3 place(0.5, 0.0, 0.5);
  const std::int64_t frame = 1000 * kMs;
  ASSERT_TRUE(feed.offer("base", place, kNow, frame).success);
  EXPECT_EQ(feed.offer("base", place, kNow, frame - 50 * kMs).code, ReasonCode::TooLate);
  ASSERT_TRUE(feed.offer("base", place, kNow, frame - 51 * kMs).success);
  ASSERT_TRUE(first("").success);
  EXPECT_EQ(goal.clock_steps, 1u);
  // An old goal that came late is as much older as its stamp is: no step.
  EXPECT_EQ(feed.offer("base", place, kNow - 200 * kMs, frame - 251 * kMs).code,
            ReasonCode::TooLate);
}

TEST_F(Feed, OneOwnerAtATimeIsFollowed) {
  see("cup", kNow, 100);
  ASSERT_TRUE(first("cup").success);
  EXPECT_EQ(goal.request, 1u);
  feed.follow("cup", goal);
  EXPECT_EQ(newest().request, 1u);
  const Answer kept = feed.offer("base", Vector3(0.9, 0, 0), 0, 0);
  EXPECT_TRUE(kept.success);
  EXPECT_NE(kept.message.find("goal_frame 'cup'"), std::string::npos);
  EXPECT_EQ(newest().position.x(), 0.5);
  const Answer early = feed.offer("base", Vector3(0.9, 0, 0), kNow + 90 * kMs, 7);
  EXPECT_EQ(early.code, ReasonCode::GoalFromFuture);
  EXPECT_EQ(feed.ahead(), 0.0) << "nobody follows the topic";
  see("cup", kNow, 100, 0.6);  // the same frame again
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.5);
  see("cup", kNow, 101, 0.6);
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.6);
  EXPECT_EQ(newest().request, 1u);
  see("cup", kNow + 50 * kMs + 1, 102, 0.7);
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.6);
  EXPECT_NEAR(feed.ahead(), 0.05, 1e-8);
  see("cup", kNow + 50 * kMs, 103, 0.7);
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.7);
  EXPECT_EQ(feed.ahead(), 0.0);
  see("cup", kNow, 0, 0.4);  // a static frame counts whenever it is seen
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.4);
  ASSERT_TRUE(first("").success);
  EXPECT_EQ(goal.request, 2u);
  feed.follow("", goal);
  EXPECT_EQ(newest().position.x(), 0.9);
  EXPECT_EQ(newest().request, 2u);
  see("cup", kNow, 200, 0.1);
  feed.poll();
  EXPECT_EQ(newest().position.x(), 0.9) << "the topic owns the goal now";
}

/// The robot with a separate frame for goals and primitives, rotated and shifted from its base.
struct Table : ::testing::Test {
  Table() {
    robot.loadBoth();
    robot.see("table", base_from_table.position, base_from_table.orientation);
    see(kGoal);
    request.orientation_control = true;
    const Quaternion hand = robot.hand().orientation;
    request.target_orientation = (base_from_table.orientation.conjugate() * hand).coeffs();
  }
  Vector3 inTable(const Vector3& in_base) const {
    return base_from_table.orientation.conjugate() * (in_base - base_from_table.position);
  }
  void see(const Vector3& in_base) { robot.see("human_hand", inTable(in_base)); }
  void run(int cycles, const Vector3& goal) {
    for (int i = 0; i < cycles; ++i) {
      see(goal);
      robot.tick();
    }
  }

  Pose base_from_table{Vector3(0.3, -0.2, 0.1),
                       Quaternion(Eigen::AngleAxisd(0.8, Vector3(0.2, 0.3, 1.0).normalized()))};
  VirtualRobot robot{"{dmp: {dmp_frame_name: table, enable_ik_debug: true}}"};
  DmpRequest request = robot.reach();
};

TEST_F(Table, AReachEndsAtTheGoalAndReportsItInBothFrames) {
  const Quaternion before = robot.hand().orientation;
  const Vector3 from = robot.hand().position;
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  EXPECT_EQ(robot.dmp().dmpFrame(), "table");
  EXPECT_EQ(robot.dmp().baseFrame(), "lwr_base_link");
  run(3, kGoal);
  IkDebugRecord record;
  ASSERT_TRUE(robot.dmp().readIkDebug(record));
  EXPECT_LT((record.set_point.position - from).norm(), 1e-3) << "it begins at the hand";
  EXPECT_LT((record.goal - kGoal).norm(), 1e-6);
  run(500, kGoal);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - kGoal).norm(), 2e-3);
  EXPECT_LT(robot.hand().orientation.angularDistance(before), 0.01);
  DmpProgress progress;
  ASSERT_TRUE(robot.dmp().readProgress(progress));
  EXPECT_LT((progress.goal.position - inTable(kGoal)).norm(), 1e-6);
  EXPECT_LT(progress.remaining_distance, 2e-3);
  EXPECT_EQ(progress.primitive.str(), "reach_human");
  EXPECT_EQ(progress.remaining_time, 0.0);
  EXPECT_EQ(progress.stamp_ns, robot.now_ns);
}

TEST_F(Table, AGivenStartAndAReplacedMotionAreInTheFrameToo) {
  request.initial_state = DmpRequest::kGiven;
  const Vector3 start = robot.hand().position + Vector3(0.0, 0.03, 0.0);
  const Vector3 velocity(0.1, 0.0, 0.05);
  request.initial_position = inTable(start);
  request.initial_velocity = base_from_table.orientation.conjugate() * velocity;
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  run(1, kGoal);
  IkDebugRecord record;
  ASSERT_TRUE(robot.dmp().readIkDebug(record));
  EXPECT_LT((record.set_point.position - start).norm(), 1e-9);
  EXPECT_LT((record.velocity - velocity).norm(), 0.01);
  run(80, kGoal);
  request.initial_state = DmpRequest::kCurrent;
  const Vector3 before = robot.handVelocity();
  ASSERT_GT(before.norm(), 0.2);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  run(1, kGoal);
  EXPECT_LT((robot.handVelocity() - before).norm(), 0.25 * before.norm());
  run(500, kGoal);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
}

TEST_F(Table, TheWorkspaceIsThatOfTheBaseAndTheTopicHasTheFrame) {
  const Vector3 outside(0.8, 0.0, -0.1), border(0.8, 0.0, 0.0);
  see(outside);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  run(5, outside);
  EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::GoalOutsideWorkspace);
  EXPECT_NE(robot.reason().find("lower side"), std::string::npos);
  EXPECT_LT((robot.dmp().motion().goal() - inTable(border)).norm(), 1e-6);
  request.goal_frame.clear();
  EXPECT_EQ(robot.dmp().setGoal("lwr_base_link", kGoal, 0).code, ReasonCode::UnknownName);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().setGoal("table", inTable(kGoal), 0)));
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  run(600, kGoal);
  EXPECT_LT((robot.hand().position - kGoal).norm(), 2e-3);
  robot.frames.frames.erase("table");
  const Answer lost = robot.dmp().execute(request);
  EXPECT_EQ(lost.code, ReasonCode::UnknownName);
  EXPECT_NE(lost.message.find("'table' (dmp_frame_name)"), std::string::npos);
}

/// If the hand never rests completely, the loop opens after half a second, within another 0.3 s.
TEST(Settling, TheLoopIsOpenedSlowlyWhereTheHandDoesNotComeToRest) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  int settled = 0, moved = 0;
  double early = 0.0, late = 0.0;
  for (int i = 0; i < 1200 && settled < 200; ++i) {
    robot.see("human_hand", kGoal);
    robot.tick();
    if (robot.state() != MotionState::Reached) continue;
    ++settled;
    robot.sample.position[0] += settled % 2 == 0 ? 0.003 : -0.003;
    const double speed = robot.command.velocity.norm();
    if (speed > 0.0) moved = settled;
    if (settled > 10 && settled <= 98) early = std::max(early, speed);
    if (settled > 150) late = std::max(late, speed);
  }
  EXPECT_NEAR(moved, 160, 2) << "0.5 s, and 0.3 s to fade";
  EXPECT_GT(early, 0.01);
  EXPECT_LT(late, 0.3 * early);
}

TEST(FrameGoal, AStepBackOfTheClockStartsAnew) {
  VirtualRobot robot;
  robot.loadBoth();
  const auto see = [&robot](std::int64_t ahead, std::uint32_t steps) {
    robot.see("human_hand", kGoal);
    robot.frames.frames["human_hand"].frame_ns += ahead;
    robot.frames.frames["human_hand"].clock_steps = steps;
  };
  see(1000 * kSecond, 0);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 200; ++i) {
    see(i < 100 ? 1000 * kSecond : 0, i < 100 ? 0 : 1);
    robot.tick();
    ASSERT_EQ(robot.state(), MotionState::Running) << "cycle " << i << ": " << robot.reason();
  }
}

/// While a motion runs, each observation is checked like the first one.
TEST(FrameGoal, AnInvalidGoalPoseIsNotFollowed) {
  VirtualRobot robot;
  robot.loadBoth();
  DmpRequest request = robot.reach();
  request.goal_offset = Vector3(0.05, 0.0, 0.0);  // the goal turns with the frame
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  for (int i = 0; i < 300; ++i) {
    robot.see("human_hand", kGoal);
    GoalObservation& seen = robot.frames.frames["human_hand"];
    if (i >= 60 && i < 90) {
      if (i % 3 == 0) seen.position.y() = std::nan("");
      if (i % 3 == 1) seen.orientation.coeffs() << 0.0, 0.0, 1.0, 1.0;
      if (i % 3 == 2) seen.orientation.coeffs()[0] = std::nan("");
    }
    robot.tick();
    ASSERT_TRUE(robot.command.velocity.allFinite()) << i;
    ASSERT_EQ(robot.state(), i < 200 ? MotionState::Running : robot.state()) << robot.reason();
    ASSERT_LT((robot.dmp().motion().goal() - kGoal - request.goal_offset).norm(), 1e-9) << i;
  }
}

}  // namespace
}  // namespace coglab_controllers
