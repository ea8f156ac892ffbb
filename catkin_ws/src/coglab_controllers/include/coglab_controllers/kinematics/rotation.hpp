/// @file
/// Logarithm and exponential of rotations, as rotation vectors (axis times angle, rad).
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Rotation by |r| rad about r.
Quaternion expRotation(const Vector3& r) noexcept;

/// Rotation vector of a unit quaternion, angle in [0, pi]; q and -q give the same vector.
Vector3 logRotation(const Quaternion& q) noexcept;

/// Rotational velocity (rad/s, base frame) that turns `from` into `to` in one second. It is diff of
/// eq. (7) and equals KDL::diff(from, to).
Vector3 rotationBetween(const Quaternion& from, const Quaternion& to) noexcept;

/// Smallest rotation from the direction `from` to the direction `to`, both nonzero. For opposite
/// directions: half a turn about any axis perpendicular to them.
Quaternion shortestTurn(const Vector3& from, const Vector3& to) noexcept;

/// True if all four entries are finite and the norm is within 1e-3 of one.
bool isUnit(const Quaternion& q) noexcept;

}  // namespace coglab_controllers
