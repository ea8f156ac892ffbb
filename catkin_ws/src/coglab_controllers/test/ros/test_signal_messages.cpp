// ROS messages as robot signals of feedback controllers.
#include <limits>

#include <gtest/gtest.h>

#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_controllers/ros/signal_messages.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {
namespace {

const bool ros_time = (ros::Time::init(), true);

geometry_msgs::Vector3 vector(double x, double y, double z) {
  geometry_msgs::Vector3 v;
  v.x = x;
  v.y = y;
  v.z = z;
  return v;
}

coglab_msgs::FingertipForces touched() {
  coglab_msgs::FingertipForces message;
  message.header.stamp = ros::Time::now();
  message.header.frame_id = "ih2_palm";
  message.phalanges = {"index_proximal", "index_distal", "little_distal"};
  message.fingers = {1, 1, 4};
  message.forces = {vector(1, 2, 3), vector(10, 20, 30), vector(-1, 0, 0)};
  message.palm = vector(0, 0, -5);
  return message;
}

std::shared_ptr<const RobotSetup> setup(const std::string& parameters) {
  const std::string description = DESCRIPTION_DIR;
  return makeRobotSetup(readText(description + "/urdf/lwr_ih2.urdf"),
                        coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml"),
                        Parameters(YAML::Load(parameters), "controller_manager"));
}

SignalFile rows(const std::string& in) {
  return readSignals(ctrl_more::ConfigNode::fromText("in:\n" + in, "signals.yaml"));
}

/// Passes a message to a stage with these rows, and returns the numbers of a signal.
template <typename Message>
Eigen::VectorXd taken(const std::string& in, const Message& message, const std::string& key) {
  FeedbackStage stage(*setup("{}"), 0.005, true);
  EXPECT_TRUE(stage.addSignals(rows(in).in).ok());
  const SignalPost post = stage.signals().post(0, SignalReading(message).message(), steadyNow());
  EXPECT_EQ(post.refusal, SignalRefusal::None) << post.text;
  CycleInput input;
  input.robot.stamp_ns = steadyNow();
  EXPECT_TRUE(stage.fill(input));
  const auto signal = stage.robot().find(ctrl_more::RobotSource::Measured, key);
  EXPECT_NE(stage.robot().stamp(signal), ctrl_more::kNeverWritten);
  return stage.robot().view(signal);
}

template <typename Message>
Message stamped() {
  Message message;
  message.header.stamp = ros::Time::now();
  return message;
}

TEST(SignalMessages, FieldsArriveInTheOrderOfTheRow) {
  auto imu = stamped<sensor_msgs::Imu>();
  imu.orientation.w = 1.0;
  imu.angular_velocity = vector(1, 2, 3);
  imu.linear_acceleration = vector(4, 5, 9.81);
  Eigen::VectorXd expected(8);
  expected << 0, 0, 0, 1, 1, 2, 3, 9.81;
  EXPECT_EQ(taken("- {topic: imu, type: sensor_msgs/Imu, key: imu, max_age: 1, field: "
                  "[orientation, angular_velocity, 'linear_acceleration[z]']}\n",
                  imu, "imu"),
            expected);

  auto joints = stamped<sensor_msgs::JointState>();
  joints.name = {"b", "a", "c"};
  joints.position = {2, 1, 3};
  joints.effort = {20, 10, 30};
  EXPECT_EQ(taken("- {topic: j, type: sensor_msgs/JointState, key: j, max_age: 1, field: "
                  "['position[a, b]', 'effort[c]']}\n",
                  joints, "j"),
            Eigen::Vector3d(1, 2, 30));
  EXPECT_EQ(taken("- {topic: j, type: sensor_msgs/JointState, key: j, max_age: 1, field: effort, "
                  "size: 3}\n",
                  joints, "j"),
            Eigen::Vector3d(20, 10, 30));

  auto wrench = stamped<geometry_msgs::WrenchStamped>();
  wrench.wrench.force = vector(1, 2, 3);
  wrench.wrench.torque = vector(4, 5, 6);
  expected.resize(6);
  expected << 1, 2, 3, 4, 5, 6;
  EXPECT_EQ(taken("- {topic: w, type: geometry_msgs/WrenchStamped, key: w, max_age: 1, field: "
                  "wrench}\n",
                  wrench, "w"),
            expected);
  auto twist = stamped<geometry_msgs::TwistStamped>();
  twist.twist.linear = vector(1, 2, 3);
  twist.twist.angular = vector(4, 5, 6);
  EXPECT_EQ(taken("- {topic: t, type: geometry_msgs/TwistStamped, key: t, max_age: 1, field: "
                  "[angular, linear]}\n",
                  twist, "t")
                .head<3>(),
            Eigen::Vector3d(4, 5, 6));
  auto pose = stamped<geometry_msgs::PoseStamped>();
  pose.pose.position.y = 7.0;
  pose.pose.orientation.w = 1.0;
  expected.resize(7);
  expected << 0, 7, 0, 0, 0, 0, 1;
  EXPECT_EQ(taken("- {topic: p, type: geometry_msgs/PoseStamped, key: p, max_age: 1, field: "
                  "pose}\n",
                  pose, "p"),
            expected);
  std_msgs::Float64MultiArray array;
  array.data = {5, 6, 7};
  EXPECT_EQ(taken("- {topic: a, type: std_msgs/Float64MultiArray, key: a, max_age: 1, field: "
                  "'data[2, 0]'}\n",
                  array, "a"),
            Eigen::Vector2d(7, 5));
}

TEST(SignalMessages, FieldsThatAreNotThereAreNamed) {
  FeedbackStage stage(*setup("{}"), 0.005, true);
  ASSERT_TRUE(
      stage
          .addSignals(
              rows("- {topic: i, type: sensor_msgs/Imu, key: i, max_age: 1, field: orientation}\n"
                   "- {topic: j, type: sensor_msgs/JointState, key: j, max_age: 1, field: "
                   "'velocity[a]'}\n"
                   "- {topic: a, type: std_msgs/Float64MultiArray, key: a, max_age: 1, field: "
                   "data, size: 2}\n")
                  .in)
          .ok());
  const auto refusal = [&](std::size_t row, const auto& message) {
    return stage.signals().post(row, SignalReading(message).message(), steadyNow());
  };
  auto imu = stamped<sensor_msgs::Imu>();
  imu.orientation_covariance[0] = -1.0;
  EXPECT_EQ(refusal(0, imu).refusal, SignalRefusal::Missing);
  EXPECT_NE(refusal(0, imu).text.find("orientation"), std::string::npos);
  auto joints = stamped<sensor_msgs::JointState>();
  joints.name = {"b"};
  joints.velocity = {1.0};
  EXPECT_EQ(refusal(1, joints).refusal, SignalRefusal::Missing);
  EXPECT_NE(refusal(1, joints).text.find("'a'"), std::string::npos);
  std_msgs::Float64MultiArray array;
  array.data = {1, 2, 3};
  EXPECT_EQ(refusal(2, array).refusal, SignalRefusal::Size);
}

TEST(Touch, ForcesOfAFingerAreTheSumOverItsPhalanges) {
  FeedbackStage stage(*setup("{tactile: true}"), 0.005, true);
  const auto touch = stage.robot().find(ctrl_more::RobotSource::Measured, "touch");
  ASSERT_EQ(touch.size(), 18);
  const SignalReading reading(touched());
  ASSERT_EQ(stage.signals().post(0, reading.message(), steadyNow()).refusal, SignalRefusal::None);
  CycleInput input;
  input.robot.stamp_ns = steadyNow();
  ASSERT_TRUE(stage.fill(input));
  Eigen::VectorXd expected = Eigen::VectorXd::Zero(18);
  expected.segment<3>(3) = Eigen::Vector3d(11, 22, 33);
  expected[12] = -1.0;
  expected[17] = -5.0;
  EXPECT_EQ(Eigen::VectorXd(stage.robot().view(touch)), expected);

  FeedbackStage without(*setup("{}"), 0.005, true);
  EXPECT_FALSE(without.robot().find(ctrl_more::RobotSource::Measured, "touch").valid());
}

TEST(Touch, BadMessagesAreRefusedWithAReason) {
  FeedbackStage stage(*setup("{tactile: true}"), 0.005, true);
  const auto refusal = [&](const coglab_msgs::FingertipForces& message) -> std::string {
    try {
      SignalReading{message};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const auto code = [&](const coglab_msgs::FingertipForces& message) {
    return stage.signals().post(0, SignalReading(message).message(), steadyNow()).refusal;
  };
  auto message = touched();
  message.header.frame_id = "world";
  EXPECT_EQ(code(message), SignalRefusal::Frame);
  message = touched();
  message.fingers.pop_back();
  EXPECT_NE(refusal(message).find("3 forces"), std::string::npos);
  message = touched();
  message.fingers[0] = 5;
  EXPECT_NE(refusal(message).find("0 .. 4"), std::string::npos);
  message = touched();
  message.palm.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(code(message), SignalRefusal::NotFinite);
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

}  // namespace
}  // namespace coglab_controllers
