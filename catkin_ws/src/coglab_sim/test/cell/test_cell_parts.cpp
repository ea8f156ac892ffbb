/// The small parts of the cell: pace, random numbers, geometry, statistics, torque sensors.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "coglab_sim/cell.hpp"
#include "coglab_sim/pace.hpp"
#include "coglab_sim/random.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

TEST(Pace, IsHalvedWhileTheComputerIsTooBusyAndComesBackCarefully) {
  ComputerLoad busy, calm;
  busy.late_steps = 0.6;
  calm.late_steps = 0.1;
  const auto secondsUntil = [](Pace& pace, const ComputerLoad& load, double factor) {
    int seconds = 0;
    while (pace.factor() != factor && seconds < 100) ++seconds, pace.update(load);
    return seconds;
  };
  Pace pace(1.0);
  EXPECT_LE(secondsUntil(pace, busy, 0.5), 3);
  EXPECT_LE(secondsUntil(pace, busy, 0.25), 3);
  for (int i = 0; i < 20; ++i) pace.update(busy);
  EXPECT_EQ(pace.factor(), 0.25) << "not slower than a quarter";
  EXPECT_TRUE(pace.busy());
  const int first = secondsUntil(pace, calm, 0.5);
  EXPECT_LE(secondsUntil(pace, busy, 0.25), 3);
  EXPECT_GT(secondsUntil(pace, calm, 0.5), first) << "more careful after it was too early";
  secondsUntil(pace, calm, 1.0);
  EXPECT_EQ(pace.factor(), 1.0);
  EXPECT_FALSE(pace.busy());

  Pace fast(2.0);
  for (int i = 0; i < 10; ++i) fast.update(busy);
  EXPECT_EQ(fast.factor(), 2.0);
}

}  // namespace

/// The estimate stays aside by the hysteresis after a movement, on the side of the movement.
TEST(TorqueSensor, TheEstimateKeepsTheSideOfTheLastMovement) {
  TorqueNoise noise;
  noise.sigma = noise.bias = 0.0;
  noise.hysteresis = 0.3;
  TorqueSensor sensor(noise, 1);
  const Vector7 ideal = Vector7::LinSpaced(-3.0, 3.0), posture = Vector7::Zero();
  const Vector7 at_rest = sensor.external(ideal, posture), measured = sensor.measured(ideal);
  const auto aside = [&] { return Vector7(sensor.external(ideal, posture) - at_rest); };
  Vector7 velocity = Vector7::Zero();
  velocity[1] = 0.1;
  velocity[4] = -0.1;
  Vector7 expected = Vector7::Zero();
  expected[1] = 0.3;
  expected[4] = -0.3;
  for (int direction : {1, -1}) {
    for (int i = 0; i < 400; ++i) sensor.advance(direction * velocity, 0.001);
    EXPECT_LT((aside() - direction * expected).cwiseAbs().maxCoeff(), 1e-3) << direction;
    for (int i = 0; i < 400; ++i) sensor.advance(Vector7::Zero(), 0.001);
    EXPECT_LT((aside() - direction * expected).cwiseAbs().maxCoeff(), 1e-3) << "after the stop";
  }
  // It reverses over hysteresis_speed: far below that the side changes slowly.
  sensor.advance(0.01 * noise.hysteresis_speed / 0.1 * velocity, 0.001);
  EXPECT_LT((aside() + expected).cwiseAbs().maxCoeff(), 0.02);
  EXPECT_EQ(sensor.measured(ideal), measured);  // the joint torque itself has none
}

/// The published reference: pcg32 with seed 42 and stream 54.
TEST(Random, IsThePublishedGenerator) {
  Random random(42, 54);
  for (const std::uint32_t expected :
       {0xa15c02b7U, 0x7b47f409U, 0xba1d3330U, 0x83d2f293U, 0xbfa4784bU, 0xcbed606eU})
    EXPECT_EQ(random.next(), expected);
  Random uniform(42, 54);
  EXPECT_DOUBLE_EQ(uniform.uniform(), 0xa15c02b7U / 4294967296.0);
  EXPECT_NE(Random(7).next(), Random(7, 1).next());
  Random plain(7), same(7, 0);
  EXPECT_EQ(plain.next(), same.next());
}

TEST(TorqueSensor, NoiseGrowsWithTheFastestJointAndIsCorrelated) {
  TorqueNoise noise;
  noise.bias = noise.offset = noise.hysteresis = 0.0;
  const Vector7 none = Vector7::Zero();
  for (const double speed : {0.0, 1.0}) {
    TorqueSensor sensor(noise, 5);
    Vector7 velocity = Vector7::Zero();
    velocity[4] = -speed;
    double measured = 0.0, external = 0.0, product = 0.0, apart = 0.0;
    Vector7 before = none;
    constexpr int kSteps = 40000;
    for (int i = 0; i < kSteps; ++i) {
      sensor.advance(velocity, 0.005);
      const Vector7 now = sensor.measured(none), estimate = sensor.external(none, none);
      measured += now.squaredNorm() / 7.0;
      external += estimate.squaredNorm() / 7.0;
      product += now.dot(before) / 7.0;
      apart += now.dot(estimate) / 7.0;
      before = now;
    }
    const double sigma = 0.05 * (1.0 + 7.0 * speed);
    EXPECT_NEAR(std::sqrt(measured / kSteps), sigma, 0.03 * sigma);
    EXPECT_NEAR(std::sqrt(external / kSteps), sigma, 0.03 * sigma);
    EXPECT_NEAR(product / measured, std::exp(-0.5), 0.02);
    EXPECT_NEAR(apart / measured, 0.0, 0.02);
  }
}

TEST(TorqueSensor, OffsetsAreAddedToTheSensorAndTakenFromTheEstimate) {
  TorqueNoise noise;
  noise.sigma = noise.bias = noise.hysteresis = 0.0;
  const TorqueSensor sensor(noise, 9);
  const Vector7 ideal = Vector7::LinSpaced(-3.0, 3.0), posture = Vector7::Ones();
  const Vector7 offset = sensor.measured(ideal) - ideal;
  EXPECT_LT((sensor.external(ideal, posture) - ideal + offset).norm(), 1e-12);
  EXPECT_LT(offset.minCoeff(), 0.0);
  EXPECT_GT(offset.maxCoeff(), 0.0);
}
