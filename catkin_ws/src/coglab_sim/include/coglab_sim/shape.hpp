/// @file
/// Simple solids: how far a point is from them, and where they touch a plane.
#pragma once

#include <string>
#include <vector>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim {

/// Box, upright cylinder (axis z) or sphere around the origin of its own frame.
class Shape {
 public:
  enum class Kind { Box, Cylinder, Sphere };

  /// @param kind  box, cylinder or sphere
  /// @param size  extents along x y z, m; a cylinder takes its diameter from x, a sphere too
  /// @throws std::invalid_argument for an unknown kind or a size that is not positive and finite.
  Shape(const std::string& kind, const Vector3d& size);

  /// Distance of a point from the surface, m, negative inside; `normal` receives the outward
  /// direction there.
  double distance(const Vector3d& point, Vector3d& normal) const;

  /// Points of the surface that can carry the solid on a plane: corners, rims, or for a sphere none
  /// (see radius()).
  const std::vector<Vector3d>& supports() const { return supports_; }
  Kind kind() const { return kind_; }
  double radius() const { return half_.x(); }
  const Vector3d& halfSize() const { return half_; }

  /// Diagonal of the inertia of a solid body of mass 1 kg, m^2.
  Vector3d unitInertia() const;

 private:
  Kind kind_;
  Vector3d half_;
  std::vector<Vector3d> supports_;
};

}  // namespace coglab_sim
