// Which sights of a goal count: one frame once, the first ones, and those after a step of the
// clock.
#include <cmath>

#include "coglab_controllers/goal/goal_relay.hpp"
#include "coglab_controllers/goal/goal_watch.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const Vector3 kGoal(0.80, 0.0, 0.45);
const Vector3 kOutlier = kGoal + Vector3(0.0, -0.5, 0.0);
constexpr std::int64_t kSecond = 1'000'000'000;

GoalObservation sight(const Vector3& position, std::int64_t frame_ns, std::int64_t stamp_ns) {
  GoalObservation seen;
  seen.position = position;
  seen.frame_ns = frame_ns;
  seen.stamp_ns = stamp_ns;
  return seen;
}

/// Looks at one frame again and again for 50 ms, as the goal helper does at 100 Hz, through a clock
/// that maps its stamp anew each time. @return how often it was to be published
int look(GoalRelay& relay, const Vector3& position, std::int64_t frame_ns) {
  int told = 0;
  for (int i = 0; i < 5; ++i) {
    const std::int64_t now = frame_ns + 10'000'000 * i;
    told += relay.see(now, sight(position, frame_ns, frame_ns + 137 * i)) ? 1 : 0;
  }
  return told;
}

TEST(GoalRelay, AFirstFrameAloneIsNoGoalHoweverOftenItIsLookedAt) {
  GoalRelay relay;
  std::int64_t t = kSecond;
  EXPECT_EQ(look(relay, kOutlier, t), 0);
  EXPECT_EQ(relay.gate().state(), GoalGate::State::Unsettled);
  for (int frame = 1; frame <= 2; ++frame) {
    EXPECT_EQ(look(relay, kGoal, t += 33'000'000), 0) << frame;
  }
  EXPECT_EQ(look(relay, kGoal, t += 33'000'000), 1);  // the third that agrees
  EXPECT_EQ(relay.goal().position, kGoal);
  EXPECT_EQ(look(relay, kGoal, t += 33'000'000), 1);
  EXPECT_EQ(look(relay, kOutlier, t += 33'000'000), 0);
  EXPECT_EQ(look(relay, kGoal, t += 33'000'000), 1);
}

TEST(GoalRelay, AStaticFrameIsToldAtOnceAndThenOnceASecond) {
  GoalRelay relay;
  int told = 0;
  for (std::int64_t i = 0; i < 350; ++i) {
    const std::int64_t now = kSecond + 10'000'000 * i;
    told += relay.see(now, sight(kGoal, 0, now)) ? 1 : 0;
    EXPECT_EQ(relay.goal().position, kGoal);
  }
  EXPECT_EQ(told, 4);
}

TEST(GoalRelay, AStaticFrameIsToldFromTheFirstMillisecondAndAfterExactlyASecond) {
  GoalRelay relay;
  const std::int64_t first = 1'000'000;  // the clock of a computer that has just started
  EXPECT_TRUE(relay.see(first, sight(kGoal, 0, first)));
  for (const std::int64_t later : {first, first + kSecond - 1}) {
    EXPECT_FALSE(relay.see(later, sight(kGoal, 0, later))) << later;
  }
  EXPECT_TRUE(relay.see(first + kSecond, sight(kGoal, 0, first + kSecond)));
  EXPECT_FALSE(relay.see(first + 2 * kSecond - 1, sight(kGoal, 0, first + 2 * kSecond - 1)));
}

TEST(GoalGate, IsLostAfterExactlyItsTimeAndKnowsNoJumpBeforeAGoal) {
  GoalGateParameters exact;
  exact.max_age = 0.25;
  exact.lost_time = 0.5;
  GoalGate gate(exact);
  for (int frame = 1; frame <= 3; ++frame) {
    EXPECT_EQ(gate.jump(), 0.0) << "no goal that it could have left";
    gate.update(frame, sight(kGoal + Vector3(0.01 * frame, 0.0, 0.0), frame, frame));
  }
  EXPECT_EQ(gate.jump(), 0.0);
  EXPECT_EQ(gate.state(), GoalGate::State::Fresh);
  const GoalObservation last = sight(kGoal, 4, 4);
  const std::int64_t half = kSecond / 2 + 4;
  EXPECT_EQ(gate.update(4, last), GoalGate::State::Fresh);
  EXPECT_NEAR(gate.jump(), 0.03, 1e-12);
  EXPECT_EQ(gate.update(half, last), GoalGate::State::Old);
  EXPECT_EQ(gate.update(half + 1, last), GoalGate::State::Lost);
  gate.reset(sight(kOutlier, 5, half));  // a motion begins, whatever came before
  EXPECT_EQ(gate.state(), GoalGate::State::Fresh);
  EXPECT_EQ(gate.age(), 0.0);
  EXPECT_EQ(gate.jump(), 0.0);
  EXPECT_EQ(gate.goal().position, kOutlier);
  EXPECT_EQ(gate.update(half, sight(kOutlier, 5, half)), GoalGate::State::Fresh);
}

TEST(GoalWatch, WhatIsExactlyAtALimitIsWithinIt) {
  const Vector3 x = Vector3::UnitX(), z = Vector3::UnitZ();
  GoalLimits limits;  // numbers that a computer has exactly
  limits.retreat = 0.25;
  GoalWatch watch;
  watch.begin(limits, Vector3::Zero(), x);
  EXPECT_EQ(watch.update(0.005, 1.25 * x).code(), ReasonCode::None);
  EXPECT_EQ(watch.update(0.005, 1.2501 * x).code(), ReasonCode::GoalWithdrawn);
  limits = {};
  limits.drop = 0.25;
  watch.begin(limits, Vector3::Zero(), x);
  EXPECT_EQ(watch.update(0.005, x - 0.25 * z).code(), ReasonCode::None);
  watch.begin(limits, Vector3::Zero(), x);
  EXPECT_EQ(watch.update(0.005, x - 0.2501 * z).code(), ReasonCode::GoalFell);
  limits = {};
  limits.region_high = Vector3(1.0, 0.0, 1.0);  // a region may be flat
  EXPECT_STREQ(limits.wrong(), "");
  watch.begin(limits, Vector3::Zero(), x);
  EXPECT_EQ(watch.update(0.005, x).code(), ReasonCode::None);
  EXPECT_EQ(watch.update(0.005, x - 0.001 * z).code(), ReasonCode::GoalLeftRegion);
  watch.begin(limits, Vector3::Zero(), x);  // what was inside before does not count
  EXPECT_EQ(watch.update(0.005, x - 0.001 * z).code(), ReasonCode::None);
}

TEST(GoalSource, KnowsNothingOfFramesAheadOfTheClockUnlessItSaysSo) {
  FrameTable frames;
  EXPECT_EQ(frames.ahead("human_hand"), 0.0);
}

TEST(GoalRelay, AfterAStepBackOfTheClockItGoesOn) {
  GoalRelay relay;
  for (int frame = 0; frame < 5; ++frame) look(relay, kGoal, kSecond * 100 + frame * 33'000'000);
  GoalObservation seen = sight(kGoal, kSecond, kSecond * 101);
  EXPECT_FALSE(relay.see(kSecond * 101, seen));  // looks like an old frame …
  ++seen.clock_steps;
  EXPECT_TRUE(relay.see(kSecond * 101, seen));  // … unless the clock was set back
  EXPECT_FALSE(relay.see(kSecond * 101, seen));
}

/// A motion that follows dmp_goal; the clock of the stamps is `ahead` of that of the samples.
struct TopicGoal : ::testing::Test {
  VirtualRobot robot;
  std::int64_t ahead = 1000 * kSecond;
  Vector3 goal = kGoal;

  void SetUp() override {
    robot.loadBoth();
    ASSERT_TRUE(VirtualRobot::ok(tell()));
    DmpRequest request = robot.reach();
    request.goal_frame.clear();
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
    run(50);
  }

  Answer tell() {
    return robot.dmp().setGoal("lwr_base_link", goal, robot.now_ns, robot.now_ns + ahead);
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      robot.tick();
      if (i % 6 == 0) {
        EXPECT_TRUE(VirtualRobot::ok(tell()));
      }
    }
  }
};

TEST_F(TopicGoal, AStepBackOfTheClockStartsAnew) {
  for (const double step : {0.2, 10.0, 500.0}) {
    ahead -= std::llround(step * 1e9);
    goal.y() += 0.05;
    run(400);
    EXPECT_LT((robot.dmp().motion().goal() - goal).norm(), 2e-3) << step << " s back";
    EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::None) << robot.reason();
  }
}

TEST_F(TopicGoal, WithoutAStepOldAndRepeatedGoalsAreRefused) {
  EXPECT_TRUE(VirtualRobot::ok(tell()));
  EXPECT_EQ(tell().code, ReasonCode::TooLate);
  const Answer late = robot.dmp().setGoal("lwr_base_link", kOutlier, robot.now_ns - kSecond,
                                          robot.now_ns - kSecond + ahead);
  EXPECT_EQ(late.code, ReasonCode::TooLate) << late.message;
  run(50);
  EXPECT_LT((robot.dmp().motion().goal() - goal).norm(), 1e-2);
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

/// While a motion runs, each sight is judged as the first one was.
TEST(FrameGoal, ASightThatIsNoPoseIsNotFollowed) {
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

TEST(FrameGoal, ASightStampedAheadOfTheClockIsNotFollowed) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  const auto tick = [&](double ahead, const Vector3& place) {
    robot.see("human_hand", place);
    GoalObservation& seen = robot.frames.frames["human_hand"];
    seen.stamp_ns += std::llround(1e9 * ahead);
    seen.frame_ns += std::llround(1e9 * ahead);
    robot.tick();
  };
  const Vector3 aside = kGoal + Vector3(0.0, 0.05, 0.0);
  for (int i = 0; i < 60; ++i) tick(0.0, kGoal);
  for (int i = 0; i < 60; ++i) {
    tick(0.2, aside);
    ASSERT_LT((robot.dmp().motion().goal() - kGoal).norm(), 1e-9) << i;
  }
  EXPECT_EQ(robot.state(), MotionState::Holding);
  EXPECT_NE(robot.reason().find("ahead of the clock"), std::string::npos) << robot.reason();
  // What clocks that are synchronised differ by is let pass.
  for (int i = 0; i < 100; ++i) tick(0.04, aside);
  EXPECT_EQ(robot.state(), MotionState::Running) << robot.reason();
  EXPECT_GT((robot.dmp().motion().goal() - kGoal).norm(), 0.04);
}

}  // namespace
}  // namespace coglab_controllers
