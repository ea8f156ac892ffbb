/// IMU and wrench sensor in the palm, against the physics.
#include <gtest/gtest.h>

#include "coglab_sim/cell.hpp"

using namespace coglab_sim;

namespace {

PalmNoise noNoise() {
  PalmNoise noise;
  noise.orientation = noise.rate = noise.acceleration = noise.force = noise.torque = 0.0;
  noise.orientation_bias = noise.rate_bias = noise.acceleration_bias = 0.0;
  noise.force_bias = noise.torque_bias = 0.0;
  return noise;
}

CellConfig config(const PalmNoise& noise, std::uint64_t seed = 1) {
  CellConfig config;
  config.urdf = URDF;
  config.seed = seed;
  config.home << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
  config.palm_noise = noise;
  return config;
}

}  // namespace

TEST(PalmSensors, AtRestMeasureGravityAndAPushInTheAxesOfThePalm) {
  Cell cell(config(noNoise()));
  const Vector3d force(3.0, -4.0, 10.0), torque(0.1, 0.2, -0.3);  // world axes
  cell.setPush({force, torque});
  for (int i = 0; i < 20; ++i) cell.step(nullptr, 0);  // on its brakes
  const Quaterniond palm = cell.plant().palm().rotation;
  const PalmReading& reading = cell.palmSensors();
  EXPECT_LT(reading.orientation.angularDistance(palm), 1e-9);
  EXPECT_LT((palm * reading.linear_acceleration - Vector3d(0.0, 0.0, 9.81)).norm(), 1e-6);
  EXPECT_LT(reading.angular_velocity.norm(), 1e-9);
  EXPECT_LT((palm * reading.force - force).norm(), 1e-9);
  EXPECT_LT((palm * reading.torque - torque).norm(), 1e-9);
}

TEST(PalmSensors, InMotionMeasureTheChangeOfVelocity) {
  plant::PlantConfig plant_config;
  plant_config.urdf = URDF;
  plant_config.home = config(noNoise()).home;
  plant::Plant plant(plant_config);
  PalmSensors sensors(noNoise(), 1);
  plant.setArm(plant_config.home, Vector7::Constant(0.3));
  plant.step(Vector7::Zero());
  sensors.observe(plant, plant::kStep);
  sensors.read();
  const Vector3d before = plant.palmTwist().linear;
  Vector3d changed = Vector3d::Zero();
  for (int i = 0; i < 100; ++i) {
    plant.step(Vector7::Zero());
    sensors.observe(plant, plant::kStep);
    sensors.read();
    const Quaterniond palm = plant.palm().rotation;
    EXPECT_LT((palm * sensors.reading().angular_velocity - plant.palmTwist().angular).norm(), 1e-9);
    const Vector3d felt = palm * sensors.reading().linear_acceleration;
    changed += plant::kStep * (felt - Vector3d(0.0, 0.0, plant::kGravity));
  }
  EXPECT_GT((plant.palmTwist().linear - before).norm(), 0.1);
  EXPECT_LT((plant.palmTwist().linear - before - changed).norm(), 1e-9);
}

TEST(PalmSensors, NoiseAndBiasAreThoseOfTheSeed) {
  const auto readings = [](std::uint64_t seed) {
    Cell cell(config(PalmNoise(), seed));
    std::vector<Vector3d> rates;
    for (int i = 0; i < 400; ++i) {
      cell.step(nullptr, 0);
      rates.push_back(cell.palmSensors().angular_velocity);
    }
    return rates;
  };
  const std::vector<Vector3d> one = readings(3), again = readings(3), other = readings(4);
  EXPECT_EQ(one.back(), again.back());
  EXPECT_NE(one.back(), other.back());
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& rate : one) mean += rate / static_cast<double>(one.size());
  double variance = 0.0;
  for (const Vector3d& rate : one) variance += (rate - mean).squaredNorm() / (3.0 * one.size());
  const PalmNoise noise;
  EXPECT_NEAR(std::sqrt(variance), noise.rate, 0.1 * noise.rate);
  EXPECT_GT(mean.norm(), 0.1 * noise.rate_bias);
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), noise.rate_bias + 0.2 * noise.rate);
}
