#include "coglab_sim/shape.hpp"

#include <cmath>
#include <stdexcept>

namespace coglab_sim {
namespace {

Shape::Kind kindOf(const std::string& name) {
  if (name == "box") return Shape::Kind::Box;
  if (name == "cylinder") return Shape::Kind::Cylinder;
  if (name == "sphere") return Shape::Kind::Sphere;
  throw std::invalid_argument("unknown shape '" + name + "'; known: box, cylinder, sphere");
}

constexpr int kRimPoints = 8;

}  // namespace

Shape::Shape(const std::string& kind, const Vector3d& size)
    : kind_(kindOf(kind)), half_(0.5 * size) {
  if (!size.allFinite() || size.minCoeff() <= 0.0) {
    throw std::invalid_argument("size of a " + kind + " must be positive, m");
  }
  if (kind_ == Kind::Box) {
    for (int corner = 0; corner < 8; ++corner) {
      supports_.emplace_back((corner & 1) != 0 ? half_.x() : -half_.x(),
                             (corner & 2) != 0 ? half_.y() : -half_.y(),
                             (corner & 4) != 0 ? half_.z() : -half_.z());
    }
  } else if (kind_ == Kind::Cylinder) {
    for (int i = 0; i < kRimPoints; ++i) {
      const double angle = 2.0 * M_PI * i / kRimPoints;
      for (const double z : {-half_.z(), half_.z()}) {
        supports_.emplace_back(half_.x() * std::cos(angle), half_.x() * std::sin(angle), z);
      }
    }
  } else {
    supports_.emplace_back(Vector3d::Zero());
  }
}

double Shape::distance(const Vector3d& point, Vector3d& normal) const {
  if (kind_ == Kind::Sphere) {
    const double r = point.norm();
    normal = r > 1e-9 ? Vector3d(point / r) : Vector3d::UnitZ();
    return r - half_.x();
  }
  if (kind_ == Kind::Cylinder) {
    const double r = std::hypot(point.x(), point.y());
    const Vector3d radial =
        r > 1e-9 ? Vector3d(point.x() / r, point.y() / r, 0.0) : Vector3d::UnitX();
    const Vector3d axial(0.0, 0.0, point.z() < 0.0 ? -1.0 : 1.0);
    const double out = r - half_.x(), up = std::abs(point.z()) - half_.z();
    if (out > 0.0 && up > 0.0) {
      normal = (out * radial + up * axial).normalized();
      return std::hypot(out, up);
    }
    normal = out > up ? radial : axial;
    return std::fmax(out, up);
  }
  const Vector3d gap = point.cwiseAbs() - half_;
  const Vector3d outside = gap.cwiseMax(0.0);
  const Vector3d sign(std::copysign(1.0, point.x()), std::copysign(1.0, point.y()),
                      std::copysign(1.0, point.z()));
  const double length = outside.norm();
  if (length > 0.0) {
    normal = outside.cwiseProduct(sign) / length;
    return length;
  }
  int axis = 0;
  const double depth = gap.maxCoeff(&axis);
  normal = Vector3d::Zero();
  normal[axis] = sign[axis];
  return depth;
}

Vector3d Shape::unitInertia() const {
  const Vector3d full = 2.0 * half_;
  if (kind_ == Kind::Sphere) return Vector3d::Constant(0.4 * half_.x() * half_.x());
  if (kind_ == Kind::Cylinder) {
    const double lateral = 0.25 * half_.x() * half_.x() + full.z() * full.z() / 12.0;
    return {lateral, lateral, 0.5 * half_.x() * half_.x()};
  }
  const Vector3d square = full.cwiseAbs2() / 12.0;
  return {square.y() + square.z(), square.x() + square.z(), square.x() + square.y()};
}

}  // namespace coglab_sim
