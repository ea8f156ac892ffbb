/// Interpolator: limits checked by differentiating the output (each quantity by one difference of
/// the next lower one), exact arrival, equality with fine numeric integration. Equality with ruckig
/// is in test_interpolator_oracle.py.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_rt {
namespace {

TEST(Interpolator, LimitsHoldByDifferentiation) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  for (const char* profile : {"default", "t1"}) {
    const JointLimits limits = loadJointLimits(LIMITS_FILE, profile);
    for (const double dt : {0.001, 0.005, 0.020, 0.100}) {
      Interpolator interpolator(limits);
      interpolator.reset(Vector7::Zero());
      Vector7 target = Vector7::Zero();
      for (int step = 0; step < 20000; ++step) {
        if (step % 17 == 0) {
          for (int i = 0; i < 7; ++i)
            target[i] = 1.5 * part(random) * limits.velocity[i];  // beyond the limit, too
        }
        const Vector7 p = interpolator.position(), v = interpolator.velocity(),
                      a = interpolator.acceleration();
        interpolator.step(target, dt);
        const Vector7 dp = (interpolator.position() - p) / dt;
        const Vector7 dv = (interpolator.velocity() - v) / dt;
        const Vector7 da = (interpolator.acceleration() - a) / dt;
        for (int i = 0; i < 7; ++i) {
          const double rounding = 4e-16 * std::abs(interpolator.position()[i]) / dt;
          ASSERT_LE(std::abs(dp[i]), limits.velocity[i] * (1.0 + 1e-9) + rounding);
          ASSERT_LE(std::abs(dv[i]), limits.acceleration[i] * (1.0 + 1e-9));
          ASSERT_LE(std::abs(da[i]), limits.jerk[i] * (1.0 + 1e-9));
        }
      }
    }
  }
}

TEST(Interpolator, ArrivesExactlyAndStays) {
  const JointLimits limits = loadJointLimits(LIMITS_FILE);
  Interpolator interpolator(limits);
  Vector7 target;
  target << 0.5, -0.5, 1.0, -1.0, 0.1, -0.1, 0.0;
  for (int i = 0; i < 1000; ++i) interpolator.step(target, 0.001);
  EXPECT_EQ(interpolator.velocity(), target);
  EXPECT_TRUE(interpolator.acceleration().isZero(0.0));
  for (int i = 0; i < 1000; ++i) interpolator.step(Vector7::Zero(), 0.001);
  EXPECT_TRUE(interpolator.standsStill());
}

TEST(Interpolator, AccelerationBeyondTheLimitComesBackFirst) {
  AxisState s{0.0, 0.0, 15.0};
  for (int i = 0; i < 500; ++i) {
    const double before = s.acceleration;
    s = advance(s, planVelocity(s.velocity, s.acceleration, 1.5, 10.0, 500.0), 0.001);
    ASSERT_LE(std::abs(s.acceleration - before), 0.5 * (1 + 1e-9));
    ASSERT_LE(s.acceleration, before > 10.0 ? before : 10.0 + 1e-9);
  }
  EXPECT_EQ(s.velocity, 1.5);
}

TEST(Interpolator, StandsOnlyWithoutVelocityAndWithoutAccelerationOfAnyJoint) {
  Interpolator interpolator(loadJointLimits(LIMITS_FILE));
  EXPECT_TRUE(interpolator.standsStill());
  for (int joint = 0; joint < 7; ++joint) {
    const Vector7 one = Vector7::Unit(joint), none = Vector7::Zero();
    interpolator.resume(one, 1e-9 * one, none);
    EXPECT_FALSE(interpolator.standsStill());
    interpolator.resume(one, none, -1e-9 * one);
    EXPECT_FALSE(interpolator.standsStill());
    EXPECT_EQ(interpolator.axis(joint).position, 1.0);
    EXPECT_EQ(interpolator.axis(joint).acceleration, -1e-9);
    interpolator.reset(one);
    EXPECT_TRUE(interpolator.standsStill());
  }
}

}  // namespace
}  // namespace coglab_rt
