// Forces of touch sensors on their way into the robot states of feedback controllers.
#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "coglab_controllers/ros/touch_topic.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {
namespace {

geometry_msgs::Vector3 vector(double x, double y, double z) {
  geometry_msgs::Vector3 v;
  v.x = x;
  v.y = y;
  v.z = z;
  return v;
}

coglab_msgs::FingertipForces touched() {
  coglab_msgs::FingertipForces message;
  message.header.frame_id = "ih2_palm";
  message.phalanges = {"index_proximal", "index_distal", "little_distal"};
  message.fingers = {1, 1, 4};
  message.forces = {vector(1, 2, 3), vector(10, 20, 30), vector(-1, 0, 0)};
  message.palm = vector(0, 0, -5);
  return message;
}

TouchForces expected() {
  TouchForces forces{};
  forces[3] = 11.0;
  forces[4] = 22.0;
  forces[5] = 33.0;
  forces[12] = -1.0;
  forces[17] = -5.0;
  return forces;
}

std::shared_ptr<const RobotSetup> setup(const std::string& parameters) {
  const std::string description = DESCRIPTION_DIR;
  return makeRobotSetup(readText(description + "/urdf/lwr_ih2.urdf"),
                        coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml"),
                        Parameters(YAML::Load(parameters), "controller_manager"));
}

TEST(Touch, ForcesOfAFingerAreTheSumOverItsPhalanges) {
  EXPECT_EQ(touchForcesOf(touched(), "ih2_palm"), expected());
}

TEST(Touch, BadMessagesAreRefusedWithWords) {
  const auto refusal = [](const coglab_msgs::FingertipForces& message) -> std::string {
    try {
      touchForcesOf(message, "ih2_palm");
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "taken";
  };
  auto message = touched();
  message.header.frame_id = "world";
  EXPECT_EQ(refusal(message), "expected forces in the frame ih2_palm, got 'world'");
  message = touched();
  message.fingers.pop_back();
  EXPECT_EQ(refusal(message), "expected a finger for each of 3 forces, got 2");
  message = touched();
  message.fingers[0] = 5;
  EXPECT_EQ(refusal(message), "expected fingers 0 .. 4, got 5");
  message = touched();
  message.palm.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(message), "expected finite forces, got one that is not");
}

TEST(Touch, SignalIsThereOnlyIfTheHandHasSensors) {
  using ctrl_more::RobotSource;
  FeedbackStage without(*setup("{}"), 0.005, true);
  EXPECT_FALSE(without.robot().find(RobotSource::Measured, "touch").valid());
  EXPECT_FALSE(without.postTouch(expected(), 1));

  FeedbackStage stage(*setup("{tactile: true}"), 0.005, true);
  const auto touch = stage.robot().find(RobotSource::Measured, "touch");
  ASSERT_EQ(touch.size(), 18);
  EXPECT_TRUE(stage.postTouch(expected(), 7'000'000));
  CycleInput input;
  input.robot.stamp_ns = 9'000'000;
  EXPECT_TRUE(stage.fill(input));
  TouchForces read{};
  const auto view = stage.robot().view(touch);
  std::copy(view.data(), view.data() + view.size(), read.begin());
  EXPECT_EQ(read, expected());
  EXPECT_EQ(stage.robot().stamp(touch), 7'000'000);
}

}  // namespace
}  // namespace coglab_controllers
