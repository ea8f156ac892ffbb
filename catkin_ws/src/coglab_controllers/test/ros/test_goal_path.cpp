// The whole path of a goal from tf to the arm, with the two real clocks of this computer: their
// stamps never agree exactly.
#include <cmath>
#include <random>
#include <thread>

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <tf2_msgs/TFMessage.h>

#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_rt/ros/ros_time.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

using coglab_rt::nanoseconds;
using coglab_rt::toSteady;

const Vector3 kGoal(0.80, 0.0, 0.45);
const Vector3 kOutlier = kGoal + Vector3(0.0, -0.5, 0.0);

/// A robot that gets its goal from tf; time is read from the clocks.
class GoalPath : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { ros::Time::init(); }

  void SetUp() override {
    robot_.loadBoth();
    robot_.dmp().setGoalSource(&source_);
  }

  void TearDown() override { robot_.dmp().setGoalSource(nullptr); }

  /// A transform of the goal frame that was captured `ahead` seconds from now.
  void see(const Vector3& position, double ahead = 0.0) {
    const std::int64_t now = static_cast<std::int64_t>(ros::Time::now().toNSec());
    geometry_msgs::TransformStamped seen;
    seen.header.stamp.fromNSec(static_cast<std::uint64_t>(now + std::llround(1e9 * ahead)));
    send(seen, position);
  }

  void send(geometry_msgs::TransformStamped& seen, const Vector3& position) {
    seen.header.frame_id = "lwr_base_link";
    seen.child_frame_id = "human_hand";
    seen.transform.translation.x = position.x();
    seen.transform.translation.y = position.y();
    seen.transform.translation.z = position.z();
    seen.transform.rotation.w = 1.0;
    tf2_msgs::TFMessage message;
    message.transforms.push_back(seen);
    listener_.receive(message, "/tracker", static_);
  }

  /// Cycles with a poll each; much more of them than frames, as on a robot.
  void tick(int cycles = 1) {
    for (int i = 0; i < cycles; ++i) {
      robot_.sample.controller_ns = robot_.now_ns =
          steadyNow() - static_cast<std::int64_t>(1e9 * robot_.period);
      robot_.tick();
    }
  }

  void begin() {
    see(kGoal);
    tick();
    ASSERT_TRUE(VirtualRobot::ok(robot_.dmp().execute(robot_.reach())));
    for (int frame = 0; frame < 5; ++frame) {
      see(kGoal);
      tick(6);
    }
  }

  /// m, the goal that the motion follows, from the true one
  double astray() { return (robot_.dmp().motion().goal() - kGoal).norm(); }

  bool static_ = false;
  tf2::BufferCore buffer_{ros::Duration(10.0)};
  TfListener listener_{buffer_};
  TfGoalSource source_{buffer_, listener_};
  VirtualRobot robot_;
};

/// Two clocks are never read at the same time, so the conversion of a stamp changes with each poll,
/// here always to a slightly later time.
TEST_F(GoalPath, OneFrameCountsOnceHoweverFarApartTheClocksAreRead) {
  std::int64_t apart = 0;
  TfGoalSource drifting(buffer_, listener_, [&apart] { return steadyNow() + (apart += 2000); });
  robot_.dmp().setGoalSource(&drifting);
  for (int trial = 0; trial < 10; ++trial) {
    begin();
    see(kOutlier);
    for (int cycle = 0; cycle < 40; ++cycle) {
      tick();
      ASSERT_LT(astray(), 1e-3) << "cycle " << cycle << " of trial " << trial;
      ASSERT_EQ(robot_.state(), MotionState::Holding);
    }
  }
  robot_.dmp().setGoalSource(&source_);
}

TEST_F(GoalPath, AStaticFrameIsFreshAsLongAsItIsShownAndOneMessageCountsOnce) {
  static_ = true;
  begin();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  tick(50);
  EXPECT_EQ(robot_.state(), MotionState::Running);
  see(kOutlier);
  tick(50);
  EXPECT_EQ(robot_.state(), MotionState::Holding);
  EXPECT_LT(astray(), 1e-3);
}

TEST_F(GoalPath, AFrameFromTheFutureIsRefusedAndTheTrackerIsFollowedOn) {
  const double ahead[] = {0.06, 0.5, 10.0, 30.0, 1e6, 1e9};
  for (const double seconds : ahead) {
    begin();
    Vector3 goal = kGoal;
    for (int frame = 0; frame < 30; ++frame) {
      if (frame % 10 == 5) see(kOutlier, seconds);
      goal.y() += 0.002;
      see(goal);
      tick(6);
      ASSERT_EQ(robot_.state(), MotionState::Running) << seconds << " s ahead, frame " << frame;
    }
    EXPECT_LT((robot_.dmp().motion().goal() - goal).norm(), 0.01) << seconds << " s ahead";
  }
}

TEST_F(GoalPath, OnlyStampsFromTheFutureGiveNoGoalWithAReason) {
  begin();
  const std::uint64_t before = listener_.refused();
  for (int frame = 0; frame < 20; ++frame) {
    see(kOutlier, 10.0);
    tick();
    std::this_thread::sleep_for(std::chrono::milliseconds(15));
  }
  EXPECT_EQ(listener_.refused(), before + 20);
  EXPECT_EQ(robot_.state(), MotionState::Holding);
  EXPECT_NE(robot_.reason().find(" s ahead"), std::string::npos) << robot_.reason();
  EXPECT_LT(astray(), 1e-3);
  EXPECT_TRUE(refused(robot_.dmp().execute(robot_.reach()), {"old", "s ahead", "synchronise"}));
  see(kGoal);
  tick();
  EXPECT_EQ(robot_.state(), MotionState::Running);
  EXPECT_EQ(listener_.ahead("human_hand"), 0.0);
}

TEST_F(GoalPath, StaticTransformOfAMovingFrameIsRefused) {
  const double ahead[] = {-1e9, -0.01, 0.04, 10.0, 1e6, 1e9};
  for (const double seconds : ahead) {
    begin();
    const std::uint64_t before = listener_.refused();
    Vector3 goal = kGoal;
    for (int frame = 0; frame < 30; ++frame) {
      static_ = true;
      if (frame % 10 == 5) see(kOutlier, seconds);
      static_ = false;
      goal.y() += 0.002;
      see(goal);
      tick(6);
      ASSERT_EQ(robot_.state(), MotionState::Running) << seconds << " s ahead, frame " << frame;
    }
    EXPECT_EQ(listener_.refused(), before + 3);
    EXPECT_LT((robot_.dmp().motion().goal() - goal).norm(), 0.01) << seconds << " s ahead";
  }
}

TEST_F(GoalPath, AnyStampAndAnyNumberIsRefusedOrKeptOutWithoutAnException) {
  begin();
  const double bad[] = {std::nan(""), INFINITY, -INFINITY, 1e308};
  std::mt19937 random(5);
  const std::uint32_t words[] = {0,          1,          999'999'999, 1'000'000'000,
                                 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
  std::uniform_int_distribution<std::size_t> pick(0, std::size(words) - 1);
  const std::string names[] = {"", "/", "human_hand", "other/", std::string(70000, 'x')};
  for (int i = 0; i < 3000; ++i) {
    geometry_msgs::TransformStamped seen;
    seen.header.stamp.sec = words[pick(random)];
    seen.header.stamp.nsec = words[pick(random)];
    seen.transform.rotation.w = i % 2 == 0 ? 1.0 : bad[i % 4];
    seen.transform.translation.x = i % 3 == 0 ? bad[i % 4] : 0.5;
    seen.header.frame_id = i % 7 == 0 ? names[i % 5] : "lwr_base_link";
    seen.child_frame_id = i % 5 == 0 ? names[(i / 5) % 5] : "other";
    tf2_msgs::TFMessage message;
    message.transforms.push_back(seen);
    listener_.receive(message, "/anybody", i % 11 == 0);
    robot_.dmp().setGoal("lwr_base_link", Vector3(0.5, 0.1, 0.5), toSteady(seen.header.stamp),
                         nanoseconds(seen.header.stamp));
    GoalObservation goal;
    std::string why;
    source_.lookup("lwr_base_link", names[static_cast<std::size_t>(i % 5)], goal, why);
    source_.lookup("lwr_base_link", "other", goal, why);
  }
  for (int frame = 0; frame < 3; ++frame) {
    see(kGoal);
    tick();
  }
  EXPECT_EQ(robot_.state(), MotionState::Running);
  EXPECT_LT(astray(), 1e-3);
}

}  // namespace
}  // namespace coglab_controllers
