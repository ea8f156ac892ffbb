/// VelocityFilter: stated delay and noise gain, no spike after losses.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "lwr_fri_bridge/motion/velocity_filter.hpp"

namespace lwr_fri_bridge {
namespace {

/// Share of a new difference quotient that one sample takes.
double weight(double time_constant, double dt) {
  return time_constant > 0.0 ? 1.0 - std::exp(-dt / time_constant) : 1.0;
}

TEST(VelocityFilter, DelayIsAsStated) {
  for (const double T : {0.0, 0.004, 0.008, 0.02}) {
    for (const double dt : {0.001, 0.005, 0.010}) {
      VelocityFilter filter(T);
      const double acceleration = 3.0;
      double t = 0.0;
      for (int i = 0; i < 2000; ++i, t += dt)
        filter.update(Vector7::Constant(0.5 * acceleration * t * t), 1, dt);
      t -= dt;
      const double lag = t - filter.velocity()[0] / acceleration;
      const double k = weight(T, dt);
      EXPECT_NEAR(lag, 0.5 * dt + dt * (1.0 - k) / k, 1e-8) << T << " " << dt;
    }
  }
}

TEST(VelocityFilter, LostSamplesMakeNoSpikeAndKeepTheTimeConstant) {
  const double dt = 0.001;
  VelocityFilter all(0.008), some(0.008);
  std::mt19937 random(4);
  std::uniform_int_distribution<int> dice(0, 9);
  std::uint32_t since = 0;
  double worst = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double t = i * dt;
    const Vector7 p = Vector7::Constant(0.3 * std::sin(2.0 * t));
    all.update(p, 1, dt);
    ++since;
    if (dice(random) < 3 && since < 20) continue;
    some.update(p, since, dt);
    since = 0;
    if (i > 100) worst = std::max(worst, std::abs(some.velocity()[0] - all.velocity()[0]));
  }
  EXPECT_LT(worst, 0.01);  // of 0.6 rad/s
}

TEST(VelocityFilter, ConstantSpeedIsExactAndTheFirstSampleGivesZero) {
  VelocityFilter filter(0.008);
  EXPECT_TRUE(filter.update(Vector7::Constant(1.0), 1, 0.005).isZero());
  for (int i = 1; i < 200; ++i) filter.update(Vector7::Constant(1.0 + 0.2 * 0.005 * i), 1, 0.005);
  EXPECT_NEAR(filter.velocity()[3], 0.2, 1e-9);
  filter.reset();
  EXPECT_TRUE(filter.update(Vector7::Constant(2.0), 1, 0.005).isZero());
}

}  // namespace
}  // namespace lwr_fri_bridge
