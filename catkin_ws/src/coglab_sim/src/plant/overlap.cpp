#include "overlap.hpp"

#include <cmath>
#include <limits>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::plant {
namespace {

/// Distance (m) from a point in the geom's frame to its surface, negative inside.
double distanceFrom(const mjModel* m, int geom, const Vector3d& p) {
  const Eigen::Map<const Vector3d> size(m->geom_size + 3 * geom);
  Vector3d beyond;
  switch (m->geom_type[geom]) {
    case mjGEOM_PLANE:
      return p.z();
    case mjGEOM_SPHERE:
      return p.norm() - size.x();
    case mjGEOM_CAPSULE:
      return Vector3d(p.x(), p.y(), std::fmax(0.0, std::abs(p.z()) - size.y())).norm() - size.x();
    case mjGEOM_CYLINDER:
      beyond = {std::hypot(p.x(), p.y()) - size.x(), std::abs(p.z()) - size.y(), -1e3};
      break;
    case mjGEOM_BOX:
      beyond = p.cwiseAbs() - size;
      break;
    default:
      return std::numeric_limits<double>::infinity();
  }
  return beyond.cwiseMax(0.0).norm() + std::fmin(0.0, beyond.maxCoeff());
}

Pose poseOf(const mjData* d, int geom) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> turn(d->geom_xmat +
                                                                            9 * geom);
  return {Eigen::Map<const Vector3d>(d->geom_xpos + 3 * geom), Quaterniond(Matrix3d(turn))};
}

/// Largest depth (m) of balls inside `inner` in `outer`.
double depthOf(const mjModel* m, const mjData* d, int inner, int outer) {
  if (m->geom_type[inner] == mjGEOM_PLANE) return 0.0;
  constexpr int kSteps = 4;  // from the middle outward
  const Eigen::Map<const Vector3d> size(m->geom_size + 3 * inner);
  const bool sphere = m->geom_type[inner] == mjGEOM_SPHERE, box = m->geom_type[inner] == mjGEOM_BOX;
  const Vector3d half = sphere ? Vector3d::Constant(size.x())
                        : box  ? Vector3d(size)
                               : Vector3d(size.x(), size.x(), size.x() + size.y());
  const Pose to_outer = poseOf(d, outer).inverse() * poseOf(d, inner);
  double depth = 0.0;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int j = -kSteps; j <= kSteps; ++j) {
      for (int k = -kSteps; k <= kSteps; ++k) {
        const Vector3d point = half.cwiseProduct(Vector3d(i, j, k)) / kSteps;
        const double ball = -distanceFrom(m, inner, point);
        if (ball > 0.0) depth = std::fmax(depth, ball - distanceFrom(m, outer, to_outer * point));
      }
    }
  }
  return depth;
}

}  // namespace

Overlap deepestOverlap(const mjModel* m, const mjData* d,
                       const std::function<bool(int one, int two)>& counts) {
  Overlap deepest;
  const auto consider = [&](int one, int two, double depth) {
    if (depth > deepest.depth) deepest = {one, two, depth};
  };
  for (int i = 0; i < d->ncon; ++i) {
    const mjContact& contact = d->contact[i];
    if (counts(contact.geom1, contact.geom2)) consider(contact.geom1, contact.geom2, -contact.dist);
  }
  for (int one = 0; one < m->ngeom; ++one) {
    for (int two = one + 1; two < m->ngeom; ++two) {
      if (m->geom_bodyid[one] == m->geom_bodyid[two] || !counts(one, two)) continue;
      consider(one, two, std::fmax(depthOf(m, d, one, two), depthOf(m, d, two, one)));
    }
  }
  return deepest;
}

}  // namespace coglab_sim::plant
