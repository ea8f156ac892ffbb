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

TEST(RobotStates, AreThoseOfTheMeasurementWithTheWrenchTurnedIntoTheBase) {
  using ctrl_more::RobotSource;
  FeedbackStage stage(*setup("{wrench_link: lwr_link_7}"), 0.005, true);
  CycleInput input;
  for (int i = 0; i < 7; ++i) {
    input.robot.position[i] = 0.1 * i;
    input.robot.velocity[i] = 1.0 + i;
    input.robot.torque[i] = 10.0 + i;
    input.robot.external_torque[i] = 20.0 + i;
  }
  input.robot.tool_wrench << 1, 2, 3, 4, 5, 6;
  input.robot.stamp_ns = 77;
  const auto robot = setup("{wrench_link: lwr_link_7}");
  input.chain = robot->chain.evaluate(input.robot.position);
  ASSERT_TRUE(stage.fill(input));
  const auto read = [&](RobotSource source, const char* name, int size) {
    const auto signal = stage.robot().find(source, name);
    EXPECT_EQ(signal.size(), size) << name;
    EXPECT_EQ(stage.robot().stamp(signal), 77) << name;
    const auto view = stage.robot().view(signal);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(view.data(), view.size()));
  };
  EXPECT_EQ(read(RobotSource::Measured, "joint_position", 7), input.robot.position);
  EXPECT_EQ(read(RobotSource::Measured, "joint_velocity", 7), input.robot.velocity);
  EXPECT_EQ(read(RobotSource::Measured, "joint_torque", 7), input.robot.torque);
  EXPECT_EQ(read(RobotSource::Measured, "external_torque", 7), input.robot.external_torque);
  const Eigen::VectorXd pose = read(RobotSource::Estimated, "ee", 7);
  EXPECT_EQ(pose.head<3>(), input.chain.tool.position);
  EXPECT_EQ(pose.tail<4>(), input.chain.tool.orientation.coeffs());
  const Chain flange(readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), "lwr_base_link",
                     "lwr_link_7");
  const Quaternion turn = flange.evaluate(input.robot.position).tool.orientation;
  const Eigen::VectorXd wrench = read(RobotSource::Measured, "wrench", 6);
  EXPECT_LT((wrench.head<3>() - turn * Vector3(1, 2, 3)).norm(), 1e-9);
  EXPECT_LT((wrench.tail<3>() - turn * Vector3(4, 5, 6)).norm(), 1e-9);
  input.robot.torque[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(stage.fill(input));
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
