#include "coglab_controllers/dmp/transformation_system.hpp"

namespace coglab_controllers {
namespace {

// Basis functions are summed up in packets of this size.
constexpr int kPacket = 4;
// Exponent below which a basis function is less than the rounding of the sum.
constexpr double kNegligible = -40.0;

}  // namespace

TransformationSystem::TransformationSystem() noexcept
    : duration_(1.0),
      stiffness_(150.0),
      damping_(2.0 * std::sqrt(150.0)),
      mapping_(ShapeMapping::None),
      demonstrated_line_(Vector3::Zero()),
      count_(kPacket) {
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
  // Whole packets: the spare ones are so far away that their share is zero.
  count_ = (count + kPacket - 1) / kPacket * kPacket;
  for (int i = count; i < count_; ++i) {
    centres_[i] = 100.0;
    widths_[i] = 1e15;
  }
}

void TransformationSystem::mapShape(const Vector3& start, const Vector3& goal) noexcept {
  shape_map_ = shapeMap(mapping_, demonstrated_line_, goal - start);
}

Vector3 TransformationSystem::movingPoint(double s) const noexcept {
  using Packet = Eigen::Array<double, kPacket, 1>;
  Eigen::Array<double, kMaxBasis, 1> exponent;
  exponent.head(count_) = -widths_.head(count_) * (s - centres_.head(count_)).square();
  // Relative to the nearest basis function, so that far from all of them the sum is still at least
  // one.
  const double nearest = exponent.head(count_).maxCoeff();
  Packet x = Packet::Zero(), y = Packet::Zero(), z = Packet::Zero(), sum = Packet::Zero();
  for (int i = 0; i < count_; i += kPacket) {
    const Packet relative = exponent.segment<kPacket>(i) - nearest;
    if (relative.maxCoeff() < kNegligible) continue;
    const Packet psi = relative.exp();
    sum += psi;
    x += psi * weights_.col(0).segment<kPacket>(i);
    y += psi * weights_.col(1).segment<kPacket>(i);
    z += psi * weights_.col(2).segment<kPacket>(i);
  }
  return shape_map_ * (Vector3(x.sum(), y.sum(), z.sum()) / sum.sum());
}

}  // namespace coglab_controllers
