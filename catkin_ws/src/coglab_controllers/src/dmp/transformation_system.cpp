#include "coglab_controllers/dmp/transformation_system.hpp"

namespace coglab_controllers {
namespace {

// A demonstration whose ends are closer than this (m) has no direction that could be mapped.
constexpr double kShortestLine = 1e-3;

}  // namespace

TransformationSystem::TransformationSystem() noexcept
    : duration_(1.0),
      stiffness_(150.0),
      damping_(2.0 * std::sqrt(150.0)),
      mapping_(ShapeMapping::None),
      demonstrated_line_(Vector3::Zero()),
      count_(4) {
  centres_.setConstant(0.5);
  widths_.setConstant(1.0);
  weights_.setZero();
}

TransformationSystem::TransformationSystem(const Primitive& primitive) : TransformationSystem() {
  validate(primitive);
  canonical_ = CanonicalSystem(primitive.alpha);
  duration_ = primitive.duration;
  stiffness_ = primitive.stiffness;
  damping_ = primitive.damping;
  goal_weight_ = primitive.goal_weight;
  mapping_ = primitive.mapping;
  demonstrated_line_ = primitive.goal - primitive.start;
  const int count = primitive.basisCount();
  centres_.head(count) = primitive.centres;
  widths_.head(count) = primitive.widths;
  weights_.topRows(count) = primitive.weights.transpose();
  // Whole packets of four: the spare ones are so far away that their share is zero.
  count_ = (count + 3) / 4 * 4;
  for (int i = count; i < count_; ++i) {
    centres_[i] = 100.0;
    widths_[i] = 1e15;
  }
}

void TransformationSystem::mapShape(const Vector3& start, const Vector3& goal) noexcept {
  shape_map_.setIdentity();
  const Vector3 line = goal - start;
  const double demonstrated = demonstrated_line_.norm(), length = line.norm();
  if (mapping_ == ShapeMapping::None || demonstrated < kShortestLine) return;
  if (length < 1e-9) {
    shape_map_.setZero();
    return;
  }
  shape_map_ =
      length / demonstrated * Quaternion::FromTwoVectors(demonstrated_line_, line).toRotationMatrix();
}

Vector3 TransformationSystem::movingPoint(double s) const noexcept {
  Eigen::Array<double, kMaxBasis, 1> psi;
  auto active = psi.head(count_);
  active = -widths_.head(count_) * (s - centres_.head(count_)).square();
  // Relative to the nearest basis function, so that far from all of them the sum is still at least one.
  active = (active - active.maxCoeff()).exp();
  const auto along = [&](int axis) { return (weights_.col(axis).head(count_) * active).sum(); };
  return shape_map_ * Vector3(along(0), along(1), along(2)) / active.sum();
}

}  // namespace coglab_controllers
