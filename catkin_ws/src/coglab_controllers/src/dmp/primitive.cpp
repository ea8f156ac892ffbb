#include "coglab_controllers/dmp/primitive.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

[[noreturn]] void fail(const std::string& field, const std::string& expected, double value) {
  std::ostringstream text;
  text << field << ": expected " << expected << ", got " << value;
  throw std::invalid_argument(text.str());
}

void requireRange(const std::string& field, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream expected;
  expected << "a number from " << low << " to " << high;
  fail(field, expected.str(), value);
}

void requirePoint(const std::string& field, const Vector3& point) {
  for (int axis = 0; axis < 3; ++axis)
    requireRange(field + "." + "xyz"[axis], point[axis], -100.0, 100.0);
}

double logistic(double x) { return 1.0 / (1.0 + std::exp(x)); }

}  // namespace

CanonicalSystem::CanonicalSystem(double alpha) : alpha_(alpha) {
  if (!(alpha > 0.0 && alpha <= 50.0)) fail("alpha", "0 < alpha <= 50", alpha);
}

double CanonicalSystem::advance(double s, double dt, double tau) const noexcept {
  return s * std::exp(-alpha_ * dt / tau);
}

double CanonicalSystem::timeAt(double s, double tau) const noexcept {
  return -std::log(s) * tau / alpha_;
}

double GoalWeight::operator()(double s) const noexcept {
  if (kind == Kind::Linear) return 1.0 - s;
  const double at_start = logistic(steepness * (1.0 - centre)),
               at_end = logistic(-steepness * centre);
  return (logistic(steepness * (s - centre)) - at_start) / (at_end - at_start);
}

Matrix3 shapeMap(ShapeMapping mapping, const Vector3& demonstrated, const Vector3& line) noexcept {
  const double from = demonstrated.norm(), to = line.norm();
  if (mapping == ShapeMapping::None || from < kShortestLine) return Matrix3::Identity();
  if (to < 1e-9) return Matrix3::Zero();
  const double scale = to / from;
  const Vector3 level_from(demonstrated.x(), demonstrated.y(), 0.0),
      level_to(line.x(), line.y(), 0.0);
  const double flat_from = level_from.norm(), flat_to = level_to.norm();
  if (mapping == ShapeMapping::Similarity || flat_from < kShortestLine || flat_to < kShortestLine) {
    return scale * shortestTurn(demonstrated, line).toRotationMatrix();
  }
  // Rotates the level part about the vertical, scales heights, and tilts along the line so that the
  // end fits.
  const Vector3 ahead_from = level_from / flat_from, ahead_to = level_to / flat_to;
  const Vector3 up = Vector3::UnitZ();
  return flat_to / flat_from *
             (ahead_to * ahead_from.transpose() +
              up.cross(ahead_to) * up.cross(ahead_from).transpose()) +
         scale * up * up.transpose() +
         (line.z() - scale * demonstrated.z()) / flat_from * up * ahead_from.transpose();
}

const char* describe(ShapeMapping mapping) noexcept {
  switch (mapping) {
    case ShapeMapping::None:
      return "none";
    case ShapeMapping::Similarity:
      return "similarity";
    case ShapeMapping::Upright:
      return "upright";
  }
  return "unknown";
}

ShapeMapping toShapeMapping(const std::string& word) {
  for (const ShapeMapping mapping :
       {ShapeMapping::None, ShapeMapping::Similarity, ShapeMapping::Upright}) {
    if (word == describe(mapping)) return mapping;
  }
  throw std::invalid_argument("mapping: expected none, similarity or upright, got '" +
                              word.substr(0, 60) + "'");
}

void validate(const Primitive& primitive) {
  const std::string& id = primitive.id;
  const bool plain =
      id.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.") ==
      std::string::npos;
  if (id.empty() || id.size() > 64 || !plain) {
    throw std::invalid_argument("id: expected 1 to 64 letters, digits, '_', '-' or '.', got '" +
                                id.substr(0, 80) + "'");
  }
  if (primitive.description.size() > 500) {
    fail("description", "at most 500 characters",
         static_cast<double>(primitive.description.size()));
  }
  requireRange("duration", primitive.duration, 0.05, 600.0);
  requireRange("alpha", primitive.alpha, 0.5, 50.0);
  requireRange("stiffness", primitive.stiffness, 1.0, 1e5);
  requireRange("damping", primitive.damping, 0.1, 1e4);
  if (primitive.goal_weight.kind == GoalWeight::Kind::Sigmoid) {
    requireRange("goal_weight.centre", primitive.goal_weight.centre, 0.0, 1.0);
    requireRange("goal_weight.steepness", primitive.goal_weight.steepness, 1.0, 100.0);
  }
  requirePoint("start.position", primitive.start);
  requirePoint("start.velocity", primitive.start_velocity);
  requirePoint("goal.position", primitive.goal);
  const Eigen::Index count = primitive.centres.size();
  if (count < 2 || count > kMaxBasis) {
    fail("basis", "2 to " + std::to_string(kMaxBasis) + " functions", static_cast<double>(count));
  }
  if (primitive.widths.size() != count || primitive.weights.cols() != count) {
    throw std::invalid_argument("basis: expected as many widths and weights as centres (" +
                                std::to_string(count) + "), got " +
                                std::to_string(primitive.widths.size()) + " and " +
                                std::to_string(primitive.weights.cols()));
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::string name = "basis[" + std::to_string(i) + "]";
    requireRange(name + ".centre", primitive.centres[i], 0.0, 1.0);
    requireRange(name + ".width", primitive.widths[i], 1e-6, 1e14);
    for (int axis = 0; axis < 3; ++axis)
      requireRange(name + ".weight", primitive.weights(axis, i), -1e4, 1e4);
  }
}

void validate(const Trajectory& trajectory) {
  const std::size_t count = trajectory.times.size();
  if (count < 5) fail("trajectory", "at least 5 samples", static_cast<double>(count));
  if (trajectory.positions.cols() != static_cast<Eigen::Index>(count)) {
    throw std::invalid_argument("trajectory: expected one position per time (" +
                                std::to_string(count) + "), got " +
                                std::to_string(trajectory.positions.cols()));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = "sample " + std::to_string(i);
    requireRange(name + " t", trajectory.times[i], -1e10, 1e10);
    if (i > 0 && !(trajectory.times[i] > trajectory.times[i - 1])) {
      fail(name + " t", "times that increase", trajectory.times[i]);
    }
    requirePoint(name + " position", trajectory.positions.col(static_cast<Eigen::Index>(i)));
  }
  requireRange("trajectory duration", trajectory.times.back() - trajectory.times.front(), 0.05,
               600.0);
}

void placeBasis(int count, double alpha, Eigen::VectorXd& centres, Eigen::VectorXd& widths) {
  centres.resize(count);
  widths.resize(count);
  for (int i = 0; i < count; ++i) centres[i] = std::exp(-alpha * i / (count - 1));
  for (int i = 0; i < count; ++i) {
    const double gap = i + 1 < count ? centres[i] - centres[i + 1] : centres[i - 1] - centres[i];
    widths[i] = 1.0 / (gap * gap);
  }
}

}  // namespace coglab_controllers
