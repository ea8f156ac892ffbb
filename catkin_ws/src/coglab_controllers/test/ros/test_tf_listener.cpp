// Transforms that the buffer accepts with a clock set by the test, and the goals made from them.
#include <cmath>
#include <string>

#include <gtest/gtest.h>
#include <ros/time.h>

#include "coglab_controllers/ros/path_topic.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"

namespace coglab_controllers {
namespace {

constexpr std::int64_t kMs = 1'000'000, kSecond = 1000 * kMs;

struct Listener : ::testing::Test {
  static void SetUpTestSuite() { ros::Time::init(); }
  Listener() { set(1000 * kSecond); }

  void set(std::int64_t now) {
    now_ns = now;
    ros::Time time;
    time.fromNSec(static_cast<std::uint64_t>(now));
    ros::Time::setNow(time);
  }
  geometry_msgs::TransformStamped seen(const std::string& frame, std::int64_t ahead) const {
    geometry_msgs::TransformStamped transform;
    transform.header.stamp.fromNSec(static_cast<std::uint64_t>(now_ns + ahead));
    transform.header.frame_id = "base";
    transform.child_frame_id = frame;
    transform.transform.translation.x = 0.5;
    transform.transform.rotation.w = 1.0;
    return transform;
  }
  void receive(const geometry_msgs::TransformStamped& transform, bool is_static = false) {
    tf2_msgs::TFMessage message;
    message.transforms.push_back(transform);
    listener.receive(message, "/tracker", is_static);
  }
  bool known(const std::string& frame) {
    std::string why;
    const bool found = source.lookup("base", frame, goal, why);
    EXPECT_EQ(why.empty(), found);
    return found;
  }

  std::int64_t now_ns = 0;
  tf2::BufferCore buffer{ros::Duration(10.0)};
  TfListener listener{buffer};
  std::int64_t steady = 77 * kSecond;
  TfGoalSource source{buffer, listener, [this] { return steady; }};
  GoalObservation goal;
};

TEST_F(Listener, ATransformMayBeFiftyMillisecondsAheadOfTheClock) {
  receive(seen("cup", 50 * kMs));
  EXPECT_EQ(listener.refused(), 0u);
  EXPECT_TRUE(known("cup"));
  EXPECT_EQ(listener.ahead("cup"), 0.0);
  receive(seen("/cup", 51 * kMs));
  EXPECT_EQ(listener.refused(), 1u);
  EXPECT_NEAR(listener.ahead("cup"), 0.051, 1e-9);
  EXPECT_NEAR(source.ahead("/cup"), 0.051, 1e-9) << "with and without a slash";
  ASSERT_TRUE(known("cup"));
  EXPECT_EQ(goal.frame_ns, now_ns + 50 * kMs) << "what is refused does not come into the buffer";
  EXPECT_EQ(listener.ahead("plate"), 0.0);
  set(now_ns + 20 * kMs);
  receive(seen("cup", 0));
  EXPECT_EQ(listener.ahead("cup"), 0.0);
  EXPECT_EQ(listener.clockSteps(), 0u);
}

TEST_F(Listener, AStaticTransformHasNoStampAndJoinsNoHistory) {
  receive(seen("table", 3600 * kSecond), true);
  ASSERT_TRUE(known("table"));
  EXPECT_EQ(goal.frame_ns, 0);
  EXPECT_EQ(goal.stamp_ns, steady) << "captured now";
  receive(seen("cup", 0));
  receive(seen("cup", 0), true);
  EXPECT_EQ(listener.refused(), 1u) << "a frame that moves";
  ASSERT_TRUE(known("cup"));
  EXPECT_NE(goal.frame_ns, 0);
}

TEST_F(Listener, AClockThatStepsBackClearsTheBuffer) {
  receive(seen("cup", 0));
  set(now_ns - 50 * kMs);
  receive(seen("cup", 0));
  EXPECT_EQ(listener.clockSteps(), 0u);
  set(now_ns - 51 * kMs);
  receive(seen("plate", 0));
  EXPECT_EQ(listener.clockSteps(), 1u);
  EXPECT_FALSE(known("cup"));
  ASSERT_TRUE(known("plate"));
  EXPECT_EQ(goal.clock_steps, 1u);
}

TEST_F(Listener, AGoalHasThePoseTheStampAndTheAgeOfItsTransform) {
  geometry_msgs::TransformStamped transform = seen("cup", -30 * kMs);
  transform.transform.translation.y = 0.2;
  transform.transform.translation.z = -0.1;
  transform.transform.rotation.w = 0.8;
  transform.transform.rotation.y = 0.6;
  receive(transform);
  ASSERT_TRUE(known("cup"));
  EXPECT_EQ(goal.position, Vector3(0.5, 0.2, -0.1));
  EXPECT_LT(goal.orientation.angularDistance(Quaternion(0.8, 0.0, 0.6, 0.0)), 1e-9);
  EXPECT_EQ(goal.frame_ns, now_ns - 30 * kMs);
  EXPECT_EQ(goal.stamp_ns, steady - 30 * kMs);
  EXPECT_FALSE(known("nowhere"));
}

TEST_F(Listener, GoodTransformsBesideARefusedOneAreAccepted) {
  tf2_msgs::TFMessage message;
  for (const char* frame : {"cup", "plate", "spoon"}) message.transforms.push_back(seen(frame, 0));
  message.transforms[1].transform.translation.z = std::nan("");
  listener.receive(message, "/tracker", false);
  EXPECT_EQ(listener.refused(), 1u);
  EXPECT_TRUE(known("cup"));
  EXPECT_FALSE(known("plate"));
  EXPECT_TRUE(known("spoon"));
}

}  // namespace
}  // namespace coglab_controllers
