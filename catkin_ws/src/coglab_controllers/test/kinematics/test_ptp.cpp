// Point-to-point motions: limits by differentiating the output, exact ends, synchronous arrival.
#include <gtest/gtest.h>

#include "coglab_controllers/ptp/ptp_trajectory.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

struct Case {
  JointVector position, velocity, target, max_velocity, max_acceleration;
};

Case randomCase(Random& random, bool from_rest) {
  Case c;
  for (int i = 0; i < kMaxJoints; ++i) {
    c.position[i] = random.uniform(-2.9, 2.9);
    c.target[i] = random.uniform(0, 1) < 0.2 ? c.position[i] : random.uniform(-2.9, 2.9);
    c.max_velocity[i] = random.uniform(0.1, 2.2);
    c.max_acceleration[i] = random.uniform(0.2, 10.0);
    c.velocity[i] = from_rest ? 0.0 : random.uniform(-1.5, 1.5) * c.max_velocity[i];
  }
  return c;
}

}  // namespace

TEST(PtpTrajectory, KeepsLimitsAndEndsExactly) {
  Random random(1);
  const int rounds = std::getenv("COGLAB_LONG") ? 1000000 : 100000;
  for (int k = 0; k < rounds; ++k) {
    const Case c = randomCase(random, k % 3 == 0);
    const PtpTrajectory trajectory(c.position, c.velocity, c.target, c.max_velocity,
                                   c.max_acceleration);
    ASSERT_TRUE(std::isfinite(trajectory.duration()));
    PtpPoint point, last;
    trajectory.at(0.0, point);
    ASSERT_LT((point.position - c.position).norm(), 1e-9);
    ASSERT_LT((point.velocity - c.velocity).norm(), 1e-9);
    const int steps = 40;
    const double h = trajectory.duration() / steps;
    for (int i = 1; i <= steps; ++i) {
      last = point;
      trajectory.at(i == steps ? trajectory.duration() : i * h, point);
      for (int j = 0; j < kMaxJoints; ++j) {
        const double fastest = std::max(c.max_velocity[j], std::abs(c.velocity[j]));
        ASSERT_LE(std::abs(point.velocity[j]), fastest * (1 + 1e-9) + 1e-9);
        ASSERT_LE(std::abs(point.velocity[j] - last.velocity[j]),
                  c.max_acceleration[j] * h * (1 + 1e-6) + 1e-8);
        ASSERT_LE(std::abs(point.position[j] - last.position[j]), fastest * h * (1 + 1e-6) + 1e-8);
      }
    }
    EXPECT_EQ(point.position, c.target);
    EXPECT_TRUE(point.velocity.isZero(0.0));
    trajectory.at(trajectory.duration() + 1.0, point);
    EXPECT_EQ(point.position, c.target);
    // No jump just before the end either.
    trajectory.at(trajectory.duration() * (1 - 1e-9), point);
    EXPECT_LT((point.position - c.target).norm(), 1e-6);
  }
}

TEST(PtpTrajectory, VelocityIsTheDerivativeOfPosition) {
  Random random(2);
  for (int k = 0; k < 2000; ++k) {
    const Case c = randomCase(random, k % 2 == 0);
    const PtpTrajectory trajectory(c.position, c.velocity, c.target, c.max_velocity,
                                   c.max_acceleration);
    const double h = 1e-5;
    for (int i = 1; i < 50; ++i) {
      const double t = trajectory.duration() * i / 50.0;
      PtpPoint a, b, middle;
      trajectory.at(t - h, a);
      trajectory.at(t + h, b);
      trajectory.at(t, middle);
      ASSERT_LT(((b.position - a.position) / (2 * h) - middle.velocity).norm(), 1e-3);
    }
  }
}

TEST(PtpTrajectory, FromRestThePathIsStraightAndAsFastAsTheLimitsAllow) {
  Random random(3);
  for (int k = 0; k < 5000; ++k) {
    const Case c = randomCase(random, true);
    const PtpTrajectory trajectory(c.position, c.velocity, c.target, c.max_velocity,
                                   c.max_acceleration);
    const JointVector way = c.target - c.position;
    double fastest = 0.0;
    for (int j = 0; j < kMaxJoints; ++j) {
      const double d = std::abs(way[j]), v = c.max_velocity[j], a = c.max_acceleration[j];
      fastest = std::max(fastest, d > v * v / a ? d / v + v / a : 2.0 * std::sqrt(d / a));
    }
    EXPECT_GE(trajectory.duration(), fastest - 1e-9);
    PtpPoint point;
    for (double share : {0.1, 0.35, 0.6, 0.9}) {
      trajectory.at(share * trajectory.duration(), point);
      const JointVector gone = point.position - c.position;
      EXPECT_LT((gone - way * (gone.dot(way) / way.squaredNorm())).norm(), 1e-9);
    }
  }
}

TEST(PtpTrajectory, OneJointIsTimeOptimal) {
  Random random(4);
  for (int k = 0; k < 20000; ++k) {
    Case c = randomCase(random, false);
    const PtpTrajectory one(c.position, c.velocity, c.target, c.max_velocity, c.max_acceleration,
                            1);
    // Bang-bang bound: the way and the speed to lose cannot be covered faster.
    const double a = c.max_acceleration[0], v0 = c.velocity[0], d = c.target[0] - c.position[0];
    const double stop = 0.5 * v0 * std::abs(v0) / a, sign = d >= stop ? 1.0 : -1.0;
    const double peak = std::sqrt(std::max(0.0, 0.5 * v0 * v0 + sign * a * d));
    const double bound = (peak - sign * v0) / a + peak / a;
    EXPECT_GE(one.duration(), bound - 1e-9);
    if (peak <= c.max_velocity[0]) {
      EXPECT_NEAR(one.duration(), bound, 1e-9);
    }
    PtpPoint point;
    one.at(0.5 * one.duration(), point);
    for (int j = 1; j < kMaxJoints; ++j) EXPECT_EQ(point.position[j], c.position[j]);
  }
}

TEST(PtpTrajectory, AMotionToThePresentPostureTakesNoTime) {
  const JointVector q = Random(5).joints(1.0), zero = JointVector::Zero(),
                    one = JointVector::Ones();
  const PtpTrajectory trajectory(q, zero, q, one, one);
  EXPECT_EQ(trajectory.duration(), 0.0);
  PtpPoint point;
  trajectory.at(0.0, point);
  EXPECT_EQ(point.position, q);
}

TEST(PtpTrajectory, ReportsTheInvalidJoint) {
  const JointVector zero = JointVector::Zero(), one = JointVector::Ones();
  JointVector bad = one;
  bad[4] = std::nan("");
  const auto message = [&](auto&&... arguments) -> std::string {
    try {
      PtpTrajectory(arguments...);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(zero, zero, bad, one, one).find("target[4]"), std::string::npos);
  EXPECT_NE(message(zero, zero, one, zero, one).find("max_vel[0]"), std::string::npos);
  EXPECT_NE(message(zero, zero, one, one, bad).find("max_acc[4]"), std::string::npos);
  EXPECT_NE(message(zero, bad, one, one, one).find("velocity[4]"), std::string::npos);
  EXPECT_NE(message(zero, zero, one, one, one, 9).find("joints"), std::string::npos);
}

TEST(PtpTrajectory, ADistanceOfOnlyRoundingTakesNoTime) {
  const JointVector q = Random(6).joints(0.5), zero = JointVector::Zero(),
                    one = JointVector::Ones();
  const JointVector target = q + JointVector::Constant(1e-13);
  const PtpTrajectory trajectory(q, zero, target, one, one);
  EXPECT_EQ(trajectory.duration(), 0.0);
  PtpPoint point;
  trajectory.at(0.0, point);
  EXPECT_EQ(point.position, target);
}
