// Learning: accuracy, several demonstrations, start velocity, invariance, bad input.
#include <gtest/gtest.h>

#include "coglab_controllers/dmp/learning.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

// Also accepts demonstrations that are not reaches.
const LearningOptions kAny = [] {
  LearningOptions options;
  options.allow = {"short", "brief", "jump", "moving", "noisy"};
  return options;
}();

// A smooth random path: minimum jerk to a random goal plus a few harmonics, and a start velocity if
// asked for.
Trajectory randomPath(Random& random, bool moving_start, int samples = 241) {
  Trajectory path;
  const double duration = random.uniform(0.8, 2.0);
  const Vector3 start = random.point(0.3), goal = start + random.point(0.5);
  const Vector3 one = random.point(0.1), two = random.point(0.05);
  const Vector3 velocity = moving_start ? random.point(0.4) : Vector3(Vector3::Zero());
  path.positions.resize(3, samples);
  for (int i = 0; i < samples; ++i) {
    const double u = static_cast<double>(i) / (samples - 1), m = minimumJerk(u);
    path.times.push_back(5.0 + u * duration);
    const double fade = (1 - u) * (1 - u) * (1 - u);
    path.positions.col(i) = start + m * (goal - start) + std::sin(M_PI * m) * one +
                            std::sin(2 * M_PI * m) * two + u * duration * fade * velocity;
  }
  return path;
}

double relativeError(const Primitive& primitive, const Trajectory& path) {
  double length = 0.0;
  for (Eigen::Index i = 1; i < path.positions.cols(); ++i) {
    length += (path.positions.col(i) - path.positions.col(i - 1)).norm();
  }
  const Eigen::Matrix3Xd error = reproduce(primitive, path.times) - path.positions;
  return std::sqrt(error.squaredNorm() / static_cast<double>(error.cols())) / length;
}

// Once around, and in the end `away` from where it began.
Trajectory loop(const Vector3& start, const Vector3& away) {
  Trajectory path = minimumJerkReach(start, start + away, 1.2, 61);
  for (Eigen::Index i = 1; i < 60; ++i) {
    const double turn = 2.0 * M_PI * minimumJerk(static_cast<double>(i) / 60.0);
    path.positions.col(i) += 0.1 * Vector3(std::sin(turn), 1.0 - std::cos(turn), 0.0);
  }
  return path;
}

}  // namespace

TEST(Learning, ReproducesItsDemonstration) {
  Random random(1);
  std::vector<double> errors;
  for (int k = 0; k < 200; ++k) {
    const Trajectory path = randomPath(random, k % 2 == 1);
    errors.push_back(relativeError(learn("path", {path}, kAny), path));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[100], 0.0010);
  EXPECT_LT(errors.back(), 0.005);
}

TEST(Learning, KeepsTheStartVelocity) {
  Random random(2);
  for (int k = 0; k < 100; ++k) {
    Trajectory path = randomPath(random, true);
    const Vector3 velocity =
        (path.positions.col(1) - path.positions.col(0)) / (path.times[1] - path.times[0]);
    EXPECT_LT((learn("path", {path}, kAny).start_velocity - velocity).norm(), 0.03);
  }
}

TEST(Learning, AveragesSeveralDemonstrations) {
  Random random(3);
  const Trajectory clean = minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0.1), 1.2);
  std::vector<Trajectory> noisy(12, clean);
  for (Trajectory& path : noisy) {
    for (Eigen::Index i = 0; i < path.positions.cols(); ++i) {
      path.positions.col(i) +=
          Vector3(random.normal(0.002), random.normal(0.002), random.normal(0.002));
    }
  }
  const double one = relativeError(learn("one", {noisy[0]}), clean);
  const double all = relativeError(learn("all", noisy), clean);
  EXPECT_LT(all, one);
  EXPECT_LT(all, 0.004);
}

TEST(Learning, DemonstrationsOfDifferentSizeAndDirectionAgreeWhenMapped) {
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const Trajectory first = minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), 1.2);
  const Trajectory second = minimumJerkReach(Vector3(1, 1, 1), Vector3(1, 0.6, 1.2), 0.9);
  const Primitive one = learn("one", {first}, options),
                  both = learn("both", {first, second}, options);
  EXPECT_LT((one.weights - both.weights).norm(), 1e-3);
  EXPECT_NEAR(both.duration, 1.05, 1e-12);
}

TEST(Learning, WorksWithEverySupportedSizeAndWeight) {
  const Trajectory path = minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0.1, 0), 1.2);
  for (int count : {2, 5, 10, 33, kMaxBasis}) {
    for (const GoalWeight& weight :
         {GoalWeight{}, GoalWeight{GoalWeight::Kind::Sigmoid, 0.4, 8.0}}) {
      LearningOptions options;
      options.basis_count = count;
      options.goal_weight = weight;
      const Primitive p = learn("path", {path}, options);
      EXPECT_LT(relativeError(p, path), count < 10 ? 0.06 : 0.003) << count;
    }
  }
}

TEST(Learning, RefusesUnusableDemonstrations) {
  const Trajectory good = minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0, 0), 1.2);
  EXPECT_THROW(learn("none", {}), std::invalid_argument);
  EXPECT_THROW(learn("bad id!", {good}), std::invalid_argument);
  EXPECT_THROW(learn("", {good}), std::invalid_argument);
  Trajectory bad = good;
  bad.positions(1, 7) = std::nan("");
  EXPECT_THROW(learn("nan", {bad}), std::invalid_argument);
  bad = good;
  bad.times[10] = bad.times[9];
  EXPECT_THROW(learn("times", {bad}), std::invalid_argument);
  bad = good;
  bad.times.pop_back();
  EXPECT_THROW(learn("lengths", {bad}), std::invalid_argument);
  EXPECT_THROW(learn("short", {minimumJerkReach(Vector3::Zero(), Vector3(1, 0, 0), 1.0, 4)}),
               std::invalid_argument);
  EXPECT_THROW(learn("still", {minimumJerkReach(Vector3::Zero(), Vector3::Zero(), 1.0)}),
               std::invalid_argument);
  LearningOptions options;
  options.basis_count = kMaxBasis + 1;
  EXPECT_THROW(learn("basis", {good}, options), std::invalid_argument);
  options = {};
  options.stiffness = -1.0;
  EXPECT_THROW(learn("stiffness", {good}, options), std::invalid_argument);
}

TEST(Learning, ADemonstrationThatComesBackToItsStartIsNotMappedToAnother) {
  // A line shorter than a millimetre has no direction and cannot be mapped.
  LearningOptions options;
  options.mapping = ShapeMapping::Similarity;
  const Vector3 here = Vector3::Zero(), there(0.0, 2.0, 0.0), way(0.5, 0.0, 0.0);
  const Vector3 less(0.9e-3, 0.0, 0.0), least(1e-3, 0.0, 0.0);
  const Trajectory reach = minimumJerkReach(here, way, 1.2);
  const std::vector<Trajectory> apart[] = {
      {loop(here, less), loop(there, less)},
      {reach, loop(there, less)},
      {loop(here, less), minimumJerkReach(there, there + way, 1.2)}};
  for (const auto& both : apart) {
    EXPECT_LT((learn("apart", both, options).start - 0.5 * there).norm(), 1e-12);
  }
  const Primitive mapped = learn("mapped", {loop(here, least), loop(there, least)}, options);
  EXPECT_LT(mapped.start.norm(), 1e-12);
  EXPECT_LT((mapped.goal - least).norm(), 1e-12);
}

TEST(Learning, ADemonstrationThatEndsInMotionKeepsItsSpeed) {
  Trajectory cut = minimumJerkReach(Vector3::Zero(), Vector3(0.5, 0.0, 0.0), 1.2);
  cut.times.resize(145);
  cut.positions.conservativeResize(3, 145);
  const Primitive p = learn("cut", {cut}, kAny);
  EXPECT_LT(relativeError(p, cut), 0.001);
  const Eigen::Matrix3Xd end = reproduce(p, {0.0, cut.times[140], cut.times[144]});
  const double expected = (cut.positions.col(144) - cut.positions.col(140)).norm();
  EXPECT_NEAR((end.col(2) - end.col(1)).norm(), expected, 0.1 * expected);
}
