/// @file
/// Orientation between start and target as a quaternion Bezier curve (D4.10 section 3.1, after eq.
/// (7)).
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Quaternion Bezier curve of degree five in cumulative form.
///
/// The curve begins with a given rotational velocity and zero acceleration and ends at rest. A turn
/// from rest follows the minimum-jerk profile. The target may change at any time: the curve then
/// bends towards the new target. It is continuous if the target is, also through half a turn. No
/// allocation, no throw.
class OrientationCurve {
 public:
  /// Begins a curve.
  /// @param start unit quaternion.  @param angular_velocity at the start, rad/s, base frame.
  /// @param target unit quaternion.  @param duration s, positive.
  void start(const Quaternion& start, const Vector3& angular_velocity, const Quaternion& target,
             double duration) noexcept;

  /// Changes the target, a unit quaternion.
  void setTarget(const Quaternion& target) noexcept;

  /// Orientation at `progress`, 0..1 of the duration; other values are clamped.
  Quaternion at(double progress) const noexcept;

 private:
  Quaternion start_ = Quaternion::Identity();
  Vector3 lead_ = Vector3::Zero();  // rotation vector of each of the first two control segments
  Vector3 turn_ =
      Vector3::Zero();  // rotation vector of the middle segment, in the frame after the first two
};

}  // namespace coglab_controllers
