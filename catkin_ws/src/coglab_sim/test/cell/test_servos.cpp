/// The joint servos of the controller stand-in on the arm of the plant.
#include <gtest/gtest.h>

#include <cmath>

#include "coglab_sim/cell.hpp"
#include "coglab_sim/krc/servos.hpp"
#include "coglab_sim/plant/plant.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;
using krc::ServoCommand;

namespace {

Vector7 posture() { return (Vector7() << 0.3, 0.6, -0.4, -1.2, 0.5, 0.8, 0.2).finished(); }

/// Servos that know their arm exactly, unless told otherwise.
struct Arm {
  explicit Arm(double error = 0.0, std::uint64_t seed = 1)
      : plant(plantConfig()), servos(URDF, parameters(error), plant::Drives{}.rotor_inertia, seed) {
    servos.observe(plant.position(), plant.velocity());
  }
  static plant::PlantConfig plantConfig() {
    plant::PlantConfig config;
    config.urdf = URDF;
    config.home = posture();
    return config;
  }
  static krc::ServoParameters parameters(double error) {
    krc::ServoParameters parameters;
    parameters.payload_error = parameters.inertia_error = error;
    return parameters;
  }
  void step(const ServoCommand& command, int steps = 1) {
    for (int i = 0; i < steps; ++i) {
      plant.step(servos.command(command, plant::kStep));
      servos.observe(plant.position(), plant.velocity());
    }
  }
  plant::Plant plant;
  krc::Servos servos;
};

ServoCommand holding() {
  ServoCommand command;
  command.position = posture();
  return command;
}

}  // namespace

TEST(Servos, ACarriedArmStaysWhereItIs) {
  Arm arm;
  ServoCommand limp;
  limp.strategy = fri::ControlStrategy::Other;
  arm.step(limp, 3000);
  EXPECT_LT((arm.plant.position() - posture()).cwiseAbs().maxCoeff(), 2e-3);
}

TEST(Servos, TorquesAreLimitedAndTheTargetIsReached) {
  Arm arm;
  ServoCommand command = holding();
  command.position = posture() + Vector7::Constant(0.5);
  const Vector7 limit = krc::ServoParameters{}.torque_limit;
  for (int i = 0; i < 2000; ++i) {
    arm.step(command);
    ASSERT_TRUE(((arm.servos.motorTorque().cwiseAbs() - limit).array() <= 1e-9).all());
  }
  EXPECT_LT((arm.plant.position() - command.position).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(Servos, TheEstimateIsTheTorqueOfAPush) {
  Arm arm;
  Wrench push;
  push.force = Vector3d(0.0, 10.0, -3.0);
  arm.plant.setPush(push);
  arm.step(holding(), 3000);
  const Vector7 felt = arm.servos.terms().jacobian.transpose() * push.stacked();
  const Vector7 estimate = arm.servos.external(arm.plant.jointTorque(), arm.plant.acceleration());
  EXPECT_LT((estimate - felt).cwiseAbs().maxCoeff(), 0.02);
}

TEST(Servos, AWrongModelShowsInTheEstimateAndIsDrawnByTheSeed) {
  Vector7 estimates[3];
  const std::uint64_t seeds[] = {1, 1, 2};
  for (int i = 0; i < 3; ++i) {
    Arm arm(0.1, seeds[i]);
    arm.step(holding(), 1000);
    estimates[i] = arm.servos.external(arm.plant.jointTorque(), arm.plant.acceleration());
    // A tenth of the hand's 0.645 kg at 1 m is 0.63 Nm.
    EXPECT_LT(estimates[i].cwiseAbs().maxCoeff(), 0.8);
  }
  EXPECT_EQ((estimates[0] - estimates[1]).norm(), 0.0);
  EXPECT_GT((estimates[0] - estimates[2]).norm(), 0.01);
}

TEST(Servos, ImpedanceYieldsByItsStiffness) {
  Arm arm;
  ServoCommand command = holding();
  command.strategy = fri::ControlStrategy::CartesianImpedance;
  command.frame = arm.servos.terms().tip;
  command.frame_stiffness << 1000.0, 1000.0, 1000.0, 100.0, 100.0, 100.0;
  command.frame_damping.setConstant(0.7);
  Wrench push;
  push.force = Vector3d(0.0, 10.0, 0.0);
  arm.plant.setPush(push);
  arm.step(command, 8000);
  const Vector3d given_way = arm.servos.terms().tip.position - command.frame.position;
  EXPECT_NEAR(given_way.y(), 0.010, 2e-4);
  EXPECT_NEAR(std::hypot(given_way.x(), given_way.z()), 0.0, 5e-4);

  Arm joints;
  command.strategy = fri::ControlStrategy::JointImpedance;
  command.stiffness.setConstant(500.0);
  command.damping.setConstant(0.7);
  joints.plant.setPush(push);
  joints.step(command, 8000);
  const Vector7 felt = joints.servos.terms().jacobian.transpose() * push.stacked();
  EXPECT_LT(((joints.plant.position() - posture()) * 500.0 - felt).cwiseAbs().maxCoeff(), 0.02);
}
