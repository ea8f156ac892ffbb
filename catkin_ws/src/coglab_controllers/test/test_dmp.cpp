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

TEST(CanonicalSystem, FollowsTheExponentialWhateverTheSteps) {
  const CanonicalSystem canonical(3.0);
  double s = 1.0;
  for (int i = 0; i < 1000; ++i) s = canonical.advance(s, 0.002, 1.5);
  EXPECT_NEAR(s, std::exp(-3.0 * 2.0 / 1.5), 1e-14);
  EXPECT_NEAR(canonical.timeAt(s, 1.5), 2.0, 1e-12);
  EXPECT_THROW(CanonicalSystem(0.0), std::invalid_argument);
  EXPECT_THROW(CanonicalSystem(std::nan("")), std::invalid_argument);
}

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
    Dmp dmp;
    dmp.start(TransformationSystem(p), start, velocity, goal, ratio);
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

TEST(Dmp, ForcingFormEqualsTheThreeParts) {
  // Eq. (4) against eq. (1), term by term, with any weight and a moving goal; its velocity has a
  // weight of its own (docs/deviations.md).
  Random random(3);
  for (int k = 0; k < 100000; ++k) {
    static const TransformationSystem system(randomPrimitive(random));
    const double w = random.uniform(0, 1), tau = random.uniform(0.2, 3);
    const Vector3 phi = random.point(1), x0 = random.point(1), g = random.point(1),
                  dg = random.point(1);
    const Vector3 x = random.point(1), v = random.point(1);
    const double stiffness = system.stiffness(), damping = system.damping();
    const Vector3 parts = (1 - w) * stiffness * (phi + x0 - x) + w * stiffness * (g - x) +
                          damping * (TransformationSystem::velocityWeight(w) * tau * dg - v);
    const Vector3 split = system.acceleration(system.forcing(w, phi, x0, g, dg, tau), x, v);
    ASSERT_LT((parts - split).norm(), 1e-11 * (1.0 + stiffness));
  }
}

TEST(Dmp, IsInvariantUnderAffineMaps) {
  Random random(4);
  for (int k = 0; k < 1000; ++k) {
    const Primitive p = randomPrimitive(random);
    Matrix3 a;
    a << random.point(2), random.point(2), random.point(2);
    const Vector3 b = random.point(3), start = random.point(1), velocity = random.point(0.5),
                  goal = random.point(1);
    Primitive mapped = p;
    mapped.weights = a * p.weights;
    Dmp one, two;
    one.start(TransformationSystem(p), start, velocity, goal, 1.0);
    two.start(TransformationSystem(mapped), a * start + b, a * velocity, a * goal + b, 1.0);
    for (int i = 0; i < 200; ++i) {
      one.step(0.005, goal);
      two.step(0.005, a * goal + b);
      ASSERT_LT((a * one.state().position + b - two.state().position).norm(), 1e-9);
    }
  }
}

TEST(Dmp, IsInvariantUnderTheTimeConstant) {
  Random random(5);
  for (int k = 0; k < 500; ++k) {
    const Primitive p = randomPrimitive(random);
    const double ratio = random.uniform(0.3, 4.0);
    Dmp one, two;
    one.start(TransformationSystem(p), p.start, p.start_velocity, p.goal, 1.0);
    two.start(TransformationSystem(p), p.start, p.start_velocity / ratio, p.goal, ratio);
    for (int i = 0; i < 100; ++i) {
      one.step(0.01 * p.duration, p.goal);
      two.step(0.01 * p.duration * ratio, p.goal);
      ASSERT_LT((one.state().position - two.state().position).norm(), 1e-9);
      ASSERT_LT((one.state().velocity - ratio * two.state().velocity).norm(), 1e-8);
    }
  }
}

TEST(Dmp, ASlowedClockKeepsThePath) {
  Random random(6);
  for (int k = 0; k < 300; ++k) {
    const Primitive p = randomPrimitive(random);
    Dmp one, two;
    one.start(TransformationSystem(p), p.start, p.start_velocity, p.goal, 1.0);
    two.start(TransformationSystem(p), p.start, p.start_velocity, p.goal, 1.0);
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
  Dmp fine;
  fine.start(TransformationSystem(p), p.start, Vector3::Zero(), p.goal, 1.0);
  runFor(fine, p.goal, 1.2, 0.0001);
  for (const double dt : {0.001, 0.004, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3, 1.2}) {
    Dmp coarse;
    coarse.start(TransformationSystem(p), p.start, Vector3::Zero(), p.goal, 1.0);
    runFor(coarse, p.goal, 1.2, dt);
    EXPECT_LT((coarse.state().position - fine.state().position).norm(), 2e-5) << dt;
  }
}

TEST(Dmp, SwitchingKeepsPhasePositionAndVelocity) {
  Random random(8);
  for (int k = 0; k < 2000; ++k) {
    const Primitive p = randomPrimitive(random), other = randomPrimitive(random);
    Dmp dmp;
    dmp.start(TransformationSystem(p), random.point(1), random.point(0.5), p.goal,
              random.uniform(0.5, 2));
    for (int i = random.integer(0, 150); i > 0; --i) dmp.step(0.005, p.goal);
    const DmpState before = dmp.state();
    dmp.switchTo(TransformationSystem(k % 2 ? p : other), p.goal, random.uniform(0.5, 2));
    EXPECT_LT((dmp.state().position - before.position).norm(), 1e-9);
    EXPECT_LT((dmp.state().velocity - before.velocity).norm(), 1e-9);
    EXPECT_EQ(dmp.state().phase, before.phase);
    // What follows starts there: a short step moves by velocity times time.
    dmp.step(1e-7, p.goal);
    EXPECT_LT((dmp.state().position - before.position - 1e-7 * before.velocity).norm(), 1e-9);
  }
}

TEST(Dmp, AChangeOfTauKeepsPositionAndVelocity) {
  Random random(9);
  for (int k = 0; k < 1000; ++k) {
    const Primitive p = randomPrimitive(random);
    Dmp dmp;
    dmp.start(TransformationSystem(p), p.start, p.start_velocity, p.goal, 1.0);
    runFor(dmp, p.goal, 0.3, 0.005);
    const DmpState before = dmp.state();
    dmp.setRatio(random.uniform(0.3, 3.0));
    EXPECT_EQ(before.position, dmp.state().position);
    EXPECT_EQ(before.velocity, dmp.state().velocity);
    EXPECT_EQ(before.phase, dmp.state().phase);
  }
}

TEST(Dmp, EndsAtTheGoalWhateverTheWeights) {
  Random random(10);
  for (int k = 0; k < 500; ++k) {
    const Primitive p = randomPrimitive(random);
    const Vector3 goal = random.point(1.0);
    Dmp dmp;
    dmp.start(TransformationSystem(p), random.point(1.0), random.point(1.0), goal, 1.0);
    runFor(dmp, goal, 12.0 * p.duration, p.duration / 50.0);
    EXPECT_LT((dmp.state().position - goal).norm(), 1e-6);
    EXPECT_LT(dmp.state().velocity.norm(), 1e-5);
  }
}

TEST(Dmp, FollowsASteadilyMovingGoalWithoutLag) {
  const Primitive p = learn("reach", {minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), 1.2)});
  Dmp with, without;
  with.start(TransformationSystem(p), p.start, Vector3::Zero(), p.goal, 1.0);
  without.start(TransformationSystem(p), p.start, Vector3::Zero(), p.goal, 1.0);
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
    Dmp dmp;
    dmp.start(TransformationSystem(p), start, Vector3::Zero(), goal, 1.0);
    double length = 0.0;
    for (int i = 0; i < 400; ++i) {
      const Vector3 before = dmp.state().position;
      dmp.step(0.005, goal);
      length += (dmp.state().position - before).norm();
    }
    EXPECT_LT(length, 1.01 * (goal - start).norm() + 1e-6);
  }
}

TEST(Dmp, RefusesAnImpossibleRatio) {
  for (const double ratio : {0.0, -1.0, 1e9, std::nan("")})
    EXPECT_THROW(requireRatio(ratio), std::invalid_argument);
  EXPECT_NO_THROW(requireRatio(1.0));
}

TEST(Dmp, ALongCycleIsDividedByTheFastestPoleAndByTheBasis) {
  // A tenth of the time constant of the linear part, half of the distance of two basis functions.
  const struct {
    double stiffness, damping, longest;  // the last in s, at a time constant of one second
    int basis;
  } cases[] = {
      {256.0, 16.0, 0.1 / 16.0, 4}, {64.0, 64.0, 0.1 / 32.0, 4}, {4.0, 4.0, 0.5 / 64.0, 64}};
  Random random(13);
  for (const auto& c : cases) {
    Primitive p = randomPrimitive(random);
    p.duration = 1.0;
    p.stiffness = c.stiffness, p.damping = c.damping;
    placeBasis(c.basis, p.alpha, p.centres, p.widths);
    p.weights.resize(3, c.basis);
    for (int i = 0; i < c.basis; ++i) p.weights.col(i) = random.point(0.5);
    const Vector3 goal = random.point(1.0), moving = random.point(0.3);
    for (const int steps : {1, 2, 20}) {
      const double time = steps * c.longest;
      Dmp dmp;
      dmp.start(TransformationSystem(p), p.start, p.start_velocity, goal, 1.0);
      dmp.step(time, goal, moving);
      const auto after = [&](int count) {
        Hoffmann reference{p, p.start, p.start, p.start_velocity, 1.0, 1.0, moving};
        const double h = time / count;
        for (int i = 0; i < count; ++i) reference.step(h, goal + i * h * moving);
        return reference.x;
      };
      EXPECT_LT((dmp.state().position - after(steps)).norm(), 1e-12) << c.basis << " " << steps;
      EXPECT_GT((dmp.state().position - after(2 * steps)).norm(), 1e-11) << "or it shows nothing";
    }
  }
}

TEST(Dmp, AStepOfNoTimeOrOfAClockThatStandsChangesNothing) {
  Random random(14);
  const Primitive p = randomPrimitive(random);
  Dmp dmp;
  dmp.start(TransformationSystem(p), p.start, p.start_velocity, p.goal, 1.0);
  dmp.step(0.1, p.goal);
  const DmpState before = dmp.state();
  for (const auto& [dt, rate] : {std::pair(0.0, 1.0), {0.1, 0.0}, {-0.1, 1.0}}) {
    const DmpState& after = dmp.step(dt, Vector3(9, 9, 9), Vector3(1, 1, 1), rate);
    EXPECT_EQ(after.position, before.position) << dt;
    EXPECT_EQ(after.velocity, before.velocity) << dt;
    EXPECT_EQ(after.acceleration, before.acceleration) << dt;
    EXPECT_EQ(after.phase, before.phase) << dt;
  }
  EXPECT_LT((dmp.step(1e-15, p.goal).position - before.position).norm(), 1e-12);
}

TEST(Dmp, ASwitchToWhatRunsChangesNothing) {
  Random random(15);
  for (const ShapeMapping mapping : {ShapeMapping::Similarity, ShapeMapping::Upright}) {
    Primitive p = randomPrimitive(random);
    p.mapping = mapping;
    const Vector3 start = random.point(0.5), goal = start + random.point(0.5);
    Dmp through, switched;
    for (Dmp* dmp : {&through, &switched})
      dmp->start(TransformationSystem(p), start, Vector3::Zero(), goal, 1.3);
    for (int i = 0; i < 120; ++i) {
      if (i == 40) switched.switchTo(TransformationSystem(p), goal, 1.3);
      ASSERT_EQ(through.step(0.005, goal).position, switched.step(0.005, goal).position) << i;
    }
    EXPECT_EQ(switched.startPosition(), start);
    EXPECT_NEAR(switched.ratio(), 1.3, 1e-12);
    switched.switchTo(TransformationSystem(p), goal, 0.7);
    EXPECT_NEAR(switched.tau(), 0.7 * p.duration, 1e-12);
  }
}

TEST(ShapeMap, UprightTurnsWhatIsLevelAndScalesHeights) {
  Random random(16);
  const Vector3 x = Vector3::UnitX(), y = Vector3::UnitY(), up = Vector3::UnitZ();
  for (int k = 0; k < 2000; ++k) {
    const Vector3 from = random.point(1), to = random.point(1);
    if (std::min(from.head<2>().norm(), to.head<2>().norm()) < 0.05) continue;
    const Matrix3 map = shapeMap(ShapeMapping::Upright, from, to);
    ASSERT_LT((map * up.cross(from) - up.cross(to)).norm(), 1e-9) << "aside stays aside";
    ASSERT_LT((map * up - to.norm() / from.norm() * up).norm(), 1e-9);
  }
  // What has exactly the least length is not shorter than it.
  EXPECT_FALSE(shapeMap(ShapeMapping::Similarity, 1e-3 * x, y).isIdentity());
  EXPECT_FALSE(shapeMap(ShapeMapping::Similarity, x, 1e-9 * y).isZero(0.0));
  const Vector3 steep = up + 1e-3 * x, flat = up + 0.5 * y;
  for (const auto& [from, to] : {std::pair(steep, flat), {flat, steep}}) {
    const Matrix3 similar = shapeMap(ShapeMapping::Similarity, from, to);
    EXPECT_GT((shapeMap(ShapeMapping::Upright, from, to) - similar).norm(), 1e-3);
  }
}
