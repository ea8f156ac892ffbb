/// Forces on the simulated hand, from the plant over the message to the signal `touch` of the robot
/// states that feedback controllers read.
#include <gtest/gtest.h>

#include <numeric>
#include <string>

#include "cell_messages.hpp"
#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_controllers/ros/signal_messages.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

using namespace coglab_sim;

namespace {

/// The hand closed around the mug, the arm on its brakes.
plant::Plant grasp() {
  plant::PlantConfig config;
  config.urdf = URDF;
  config.home << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
  config.surroundings.board_size.setZero();
  return plant::Plant(config);
}

std::shared_ptr<const coglab_controllers::RobotSetup> tactileSetup() {
  using namespace coglab_controllers;
  return makeRobotSetup(readText(URDF), coglab_rt::loadJointLimits(LIMITS_FILE),
                        Parameters(YAML::Load("{tactile: true}"), "controller_manager"));
}

}  // namespace

TEST(TouchSignal, EqualsTheContactForcesOfThePlant) {
  plant::Plant plant = grasp();
  plant.setBrakes(true);
  const double shape[] = {245.0, 5.0, 30.0, 50.0, 50.0};
  for (int motor = 0; motor < 5; ++motor) plant.motors().set(motor, shape[motor] / 255.0);
  for (int i = 0; i < 300; ++i) plant.step(Vector7::Zero());
  Pose in_palm;
  in_palm.rotation = Quaterniond(0.5, -0.5, -0.5, -0.5);
  in_palm.position = Vector3d(0.04, 0.0, 0.0) - in_palm.rotation * Vector3d(0.0, 0.0, 0.05);
  plant.place(plant::Place::RobotHand, in_palm);
  for (int i = 0; i < 300; ++i) plant.step(Vector7::Zero());
  const plant::Touch& touch = plant.touch();
  ASSERT_LT(touch.palm.x(), -1.0) << "the mug presses into the palm";

  const auto message =
      touchMessage(touch, plant.config().hand, (ros::Time::init(), ros::Time::now()));
  coglab_controllers::FeedbackStage stage(*tactileSetup(), 0.005, true);
  const auto signal = stage.robot().find(ctrl_more::RobotSource::Measured, "touch");
  const coglab_controllers::SignalReading reading(message);
  const std::int64_t now = coglab_rt::steadyNow();
  const auto post = stage.signals().post(0, reading.message(), now);
  ASSERT_EQ(post.refusal, coglab_controllers::SignalRefusal::None) << post.text;
  coglab_controllers::CycleInput input;
  input.robot.stamp_ns = now;
  ASSERT_TRUE(stage.fill(input));
  const auto read = stage.robot().view(signal);
  ASSERT_EQ(read.size(), 18);

  // Thumb, index, middle, ring, little, then the palm; of a finger the sum over its phalanges.
  Eigen::Matrix<double, 18, 1> expected = Eigen::Matrix<double, 18, 1>::Zero();
  for (std::size_t i = 0; i < touch.phalanges.size(); ++i) {
    const auto finger = static_cast<Eigen::Index>(plant.config().hand.phalanges[i].finger);
    expected.segment<3>(3 * finger) += touch.phalanges[i];
  }
  expected.tail<3>() = touch.palm;
  for (Eigen::Index i = 0; i < 18; ++i) EXPECT_NEAR(read.data()[i], expected[i], 1e-12) << i;
  for (int finger = 1; finger < 5; ++finger)
    EXPECT_GT(read.data()[3 * finger], 0.1) << "finger " << finger << " is pushed away";
}
