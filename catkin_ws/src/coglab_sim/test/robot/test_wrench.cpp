/// One convention for the estimated wrench from end to end: on the wire in the base's axes about
/// the palm, on `tool_wrench` in the palm's own axes, for feedback controllers in the base's axes
/// again.
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <iterator>
#include <string>

#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "coglab_sim/virtual_robot.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

struct Felt {
  Eigen::VectorXd wire, topic, feedback;
};

/// A known force and torque on the palm (base axes) in a posture, and its value at each place.
Felt pushed(const Vector7& posture, const Vector6& push) {
  CellConfig config;
  config.urdf = URDF;
  config.home = posture;
  config.torque_noise.sigma = config.torque_noise.bias = config.torque_noise.hysteresis = 0.0;
  config.torque_noise.offset = config.servos.payload_error = config.servos.inertia_error = 0.0;
  Cell cell(config);
  lwr_fri_bridge::BridgeConfig bridge_config;
  bridge_config.limits = coglab_rt::loadJointLimits(LIMITS_FILE);
  lwr_fri_bridge::Bridge bridge(bridge_config);
  cell.setPush({push.head<3>(), push.tail<3>()});

  Felt felt;
  std::int64_t now = 1'000'000'000;
  fri::CommandDatagram command;
  std::array<std::uint8_t, fri::kCommandSize> answer{};
  bool answered = false;
  for (int i = 0; i < 200; ++i, now += 5'000'000) {  // it stands on its brakes
    cell.step(answered ? answer.data() : nullptr, answer.size());
    answered = cell.sent() &&
               bridge.answer(cell.measurement().data(), cell.measurement().size(), now, command);
    if (answered) fri::encode(command, answer.data());
  }
  fri::MeasurementDatagram measurement;
  EXPECT_TRUE(fri::decode(cell.measurement().data(), cell.measurement().size(), measurement));
  felt.wire = fri::wrenchFromWire(measurement.external_wrench);
  const coglab_rt::RobotSample sample = bridge.snapshot().sample;
  felt.topic = sample.tool_wrench;

  std::ifstream file(URDF);
  const std::string urdf((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const auto setup = coglab_controllers::makeRobotSetup(
      urdf, bridge_config.limits, coglab_controllers::Parameters(YAML::Node(), "test"));
  ctrl_more::Logger silent;
  coglab_controllers::FeedbackStage stage(*setup, 0.005, true, &silent);
  coglab_controllers::CycleInput input;
  input.robot = sample;
  setup->chain.evaluate(sample.position, input.chain);
  EXPECT_TRUE(stage.fill(input));
  EXPECT_TRUE(stage.robot().getMeasuredData("wrench", felt.feedback).ok());
  return felt;
}

}  // namespace

TEST(Wrench, AKnownForceIsTheSameFromTheWireToTheFeedbackControllers) {
  Vector7 reaching;
  reaching << 0.3, 0.6, -0.4, -1.2, 0.5, 0.8, 0.2;
  const Vector7 turned = CellConfig().home;
  for (const Vector7& posture : {reaching, turned}) {
    for (int direction = 0; direction < 3; ++direction) {
      Vector6 push = Vector6::Zero();
      push[direction] = 8.0;                // N along +x, +y, +z of the base
      push[3 + (direction + 1) % 3] = 0.7;  // Nm
      const Felt felt = pushed(posture, push);
      EXPECT_LT((felt.wire - push).cwiseAbs().maxCoeff(), 0.05) << felt.wire.transpose();
      EXPECT_LT((felt.feedback - push).cwiseAbs().maxCoeff(), 0.05) << felt.feedback.transpose();
      // The palm's own axes, by the simulator's kinematics and not by the bridge's.
      ArmTerms terms;
      ArmModel(URDF).evaluate(posture, Vector7::Zero(), terms);
      const Eigen::Matrix3d palm = terms.tip.rotation.toRotationMatrix();
      Vector6 expected;
      expected << palm.transpose() * push.head<3>(), palm.transpose() * push.tail<3>();
      EXPECT_LT((felt.topic - expected).cwiseAbs().maxCoeff(), 0.05) << felt.topic.transpose();
      EXPECT_GT((felt.topic - push).cwiseAbs().maxCoeff(), 1.0);  // the two really differ
    }
  }
}
