// Eq. (1)-(5): identities, invariances and continuity of a running primitive.
#include <gtest/gtest.h>

#include "coglab_controllers/dmp/dmp.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

// Hoffmann et al. 2009: tau v' = K (g - x) - D v - K (g - x0) s + K f(s), with f(s) = s sum(w psi)
// / sum(psi), integrated by its own Runge-Kutta code with the same steps.
// A goal that moves adds its velocity with a weight of its own (docs/deviations.md).
struct Hoffmann {
  const Primitive& p;
  Vector3 x0, x, v;
  double s = 1.0, tau;
  Vector3 goal_velocity = Vector3::Zero();

  Vector3 slope(double phase, const Vector3& xx, const Vector3& vv, const Vector3& g) const {
    Vector3 sum = Vector3::Zero();
    double norm = 0.0;
    for (int i = 0; i < p.basisCount(); ++i) {
      const double psi = std::exp(-p.widths[i] * (phase - p.centres[i]) * (phase - p.centres[i]));
      sum += psi * p.weights.col(i);
      norm += psi;
    }
    const Vector3 f = phase * sum / norm;
    const double w = 1.0 - phase, lead = w * w * (3.0 - 2.0 * w) * tau;
    return (p.stiffness * (g - xx) - p.damping * vv - p.stiffness * (g - x0) * phase +
            p.stiffness * f + p.damping * lead * goal_velocity) /
           tau;
  }

  void step(double h, const Vector3& g) {
    const double s1 = s * std::exp(-p.alpha * 0.5 * h / tau), s2 = s * std::exp(-p.alpha * h / tau);
    const Vector3 half = g + 0.5 * h * goal_velocity, end = g + h * goal_velocity;
    const Vector3 a1 = v / tau, b1 = slope(s, x, v, g);
    const Vector3 a2 = (v + 0.5 * h * b1) / tau,
                  b2 = slope(s1, x + 0.5 * h * a1, v + 0.5 * h * b1, half);
    const Vector3 a3 = (v + 0.5 * h * b2) / tau,
                  b3 = slope(s1, x + 0.5 * h * a2, v + 0.5 * h * b2, half);
    const Vector3 a4 = (v + h * b3) / tau, b4 = slope(s2, x + h * a3, v + h * b3, end);
    x += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    v += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4);
    s = s2;
  }
};

DmpState runFor(Dmp& dmp, const Vector3& goal, double duration, double dt) {
  const int steps = static_cast<int>(std::lround(duration / dt));
  for (int i = 0; i < steps; ++i) dmp.step(dt, goal);
  return dmp.state();
}

}  // namespace

TEST(GoalWeight, GoesFromZeroToOne) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const GoalWeight weight{i % 2 ? GoalWeight::Kind::Linear : GoalWeight::Kind::Sigmoid,
                            random.uniform(0, 1), random.uniform(1, 100)};
    EXPECT_NEAR(weight(1.0), 0.0, 1e-12);
    EXPECT_NEAR(weight(0.0), 1.0, 1e-12);
    double last = 1.0;
    for (double s = 0.0; s <= 1.0; s += 0.05) {
      EXPECT_LE(weight(s), last + 1e-12);
      last = weight(s);
    }
  }
}

TEST(Dmp, EqualsHoffmannPastor2009) {
  Random random(2);
  double worst = 0.0;
  for (int k = 0; k < 2000; ++k) {
    Primitive p = randomPrimitive(random);
    const Vector3 start = random.point(1.0), velocity = random.point(0.5), goal = random.point(1.0);
    const double ratio = random.uniform(0.5, 2.0);
    Dmp dmp(p);
    dmp.start(start, velocity, goal, ratio);
    Hoffmann reference{p, start, start, ratio * p.duration * velocity, 1.0, ratio * p.duration};
    // Short enough for one sub-step, so that both take the same steps.
    const double dt = 0.004 * reference.tau / std::max(1.0, std::sqrt(p.stiffness) / 12.0);
    Vector3 moving = goal;
    for (int i = 0; i < 120; ++i) {
      if (i % 40 == 39) moving += random.point(0.1);
      dmp.step(dt, moving);
      reference.step(dt, moving);
    }
    worst = std::max(worst, (dmp.state().position - reference.x).cwiseAbs().maxCoeff());
    worst = std::max(worst, std::abs(dmp.state().phase - reference.s));
  }
  EXPECT_LT(worst, 1e-12);
}

TEST(Dmp, ASlowedClockKeepsThePath) {
  Random random(6);
  for (int k = 0; k < 300; ++k) {
    const Primitive p = randomPrimitive(random);
    Dmp one(p), two(p);
    one.start(p.start, p.start_velocity, p.goal, 1.0);
    two.start(p.start, p.start_velocity, p.goal, 1.0);
    for (int i = 0; i < 100; ++i) {
      one.step(0.005, p.goal);
      two.step(0.01, p.goal, Vector3::Zero(), 0.5);
      ASSERT_LT((one.state().position - two.state().position).norm(), 1e-12);
    }
    const DmpState before = two.state();
    two.step(0.005, p.goal, Vector3::Zero(), 0.0);
    EXPECT_EQ(before.position, two.state().position);
    EXPECT_EQ(before.phase, two.state().phase);
  }
}

TEST(Dmp, AnyCycleTimeGivesTheSameMotion) {
  Random random(7);
  const Primitive p =
      learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0.1, -0.2), 1.2)});
  Dmp fine(p);
  fine.start(p.start, Vector3::Zero(), p.goal, 1.0);
  runFor(fine, p.goal, 1.2, 0.0001);
  for (const double dt : {0.001, 0.004, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3, 1.2}) {
    Dmp coarse(p);
    coarse.start(p.start, Vector3::Zero(), p.goal, 1.0);
    runFor(coarse, p.goal, 1.2, dt);
    EXPECT_LT((coarse.state().position - fine.state().position).norm(), 2e-5) << dt;
  }
}

TEST(Dmp, SwitchingKeepsPhasePositionAndVelocity) {
  Random random(8);
  for (int k = 0; k < 2000; ++k) {
    const Primitive p = randomPrimitive(random), other = randomPrimitive(random);
    Dmp dmp(p);
    dmp.start(random.point(1), random.point(0.5), p.goal, random.uniform(0.5, 2));
    for (int i = random.integer(0, 150); i > 0; --i) dmp.step(0.005, p.goal);
    const DmpState before = dmp.state();
    dmp.switchTo(Dmp(k % 2 ? p : other), p.goal, random.uniform(0.5, 2));
    EXPECT_LT((dmp.state().position - before.position).norm(), 1e-9);
    EXPECT_LT((dmp.state().velocity - before.velocity).norm(), 1e-9);
    EXPECT_EQ(dmp.state().phase, before.phase);
    // What follows starts there: a short step moves by velocity times time.
    dmp.step(1e-7, p.goal);
    EXPECT_LT((dmp.state().position - before.position - 1e-7 * before.velocity).norm(), 1e-9);
  }
}

TEST(Dmp, FollowsASteadilyMovingGoalWithoutLag) {
  const Primitive p = learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), 1.2)});
  Dmp with(p), without(p);
  with.start(p.start, Vector3::Zero(), p.goal, 1.0);
  without.start(p.start, Vector3::Zero(), p.goal, 1.0);
  const Vector3 speed(0.0, 0.1, 0.0);
  Vector3 goal = p.goal;
  for (int i = 0; i < 800; ++i) {
    with.step(0.005, goal, speed);
    without.step(0.005, goal);
    goal += 0.005 * speed;
  }
  EXPECT_LT((with.state().position - goal).norm(), 1e-5);
  // Without the goal's velocity: 2 tau v / sqrt(K).
  EXPECT_NEAR((without.state().position - goal).norm(), 2 * 1.2 * 0.1 / std::sqrt(150.0), 1e-3);
}

TEST(ShapeMap, TakesTheDemonstratedLineToTheNewOne) {
  Random random(11);
  for (int k = 0; k < 20000; ++k) {
    const Vector3 from = random.point(1), to = random.point(1);
    for (const ShapeMapping mapping : {ShapeMapping::Similarity, ShapeMapping::Upright}) {
      ASSERT_LT((shapeMap(mapping, from, to) * from - to).norm(), 1e-9) << describe(mapping);
    }
    // A similarity: the smallest rotation from one line to the other, and one scale. It leaves the
    // axis across both lines where it is, but for the scale.
    const Matrix3 similar = shapeMap(ShapeMapping::Similarity, from, to);
    const double scale = to.norm() / from.norm();
    const Vector3 across = from.cross(to);
    ASSERT_LT((similar.transpose() * similar - scale * scale * Matrix3::Identity()).norm(),
              1e-9 * scale * scale);
    ASSERT_GT(similar.determinant(), 0.0);
    ASSERT_LT((similar * across - scale * across).norm(), 1e-9 * scale);
    const Matrix3 upright = shapeMap(ShapeMapping::Upright, from, to);
    EXPECT_GT(upright.col(2).z(), 0.0);
    EXPECT_EQ(upright.col(2).head<2>().norm(), 0.0);
  }
  EXPECT_TRUE(shapeMap(ShapeMapping::Similarity, Vector3::UnitX(), Vector3::Zero()).isZero());
  EXPECT_TRUE(shapeMap(ShapeMapping::None, Vector3::UnitX(), Vector3::UnitY()).isIdentity());
}

TEST(Dmp, AMappedShapeReachesAGoalInAnotherDirectionWithoutADetour) {
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const Primitive p =
      learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), 1.2)}, options);
  Random random(12);
  for (int k = 0; k < 200; ++k) {
    const Vector3 start = random.point(0.5), goal = start + random.point(0.6);
    Dmp dmp(p);
    dmp.start(start, Vector3::Zero(), goal, 1.0);
    double length = 0.0;
    for (int i = 0; i < 400; ++i) {
      const Vector3 before = dmp.state().position;
      dmp.step(0.005, goal);
      length += (dmp.state().position - before).norm();
    }
    EXPECT_LT(length, 1.01 * (goal - start).norm() + 1e-6);
  }
}

TEST(ShapeMap, UprightTurnsTheLevelPartAndScalesHeights) {
  Random random(16);
  const Vector3 x = Vector3::UnitX(), y = Vector3::UnitY(), up = Vector3::UnitZ();
  for (int k = 0; k < 2000; ++k) {
    const Vector3 from = random.point(1), to = random.point(1);
    if (std::min(from.head<2>().norm(), to.head<2>().norm()) < 0.05) continue;
    const Matrix3 map = shapeMap(ShapeMapping::Upright, from, to);
    ASSERT_LT((map * up.cross(from) - up.cross(to)).norm(), 1e-9) << "aside stays aside";
    ASSERT_LT((map * up - to.norm() / from.norm() * up).norm(), 1e-9);
  }
  const Vector3 steep = up + 1e-3 * x, flat = up + 0.5 * y;
  for (const auto& [from, to] : {std::pair(steep, flat), {flat, steep}}) {
    const Matrix3 similar = shapeMap(ShapeMapping::Similarity, from, to);
    EXPECT_GT((shapeMap(ShapeMapping::Upright, from, to) - similar).norm(), 1e-3);
  }
}
