#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace ctrl_more {

/// Rotation vector (axis times angle, angle in [0, pi]) of a unit quaternion [rad].
inline Eigen::Vector3d logOf(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const double sine = rotation.vec().norm();
  const double angle = 2.0 * std::atan2(sine, sign * rotation.w());
  const double scale = sine > 1e-12 ? sign * angle / sine : sign * 2.0;
  return scale * rotation.vec();
}

/// Unit quaternion of a rotation vector [rad].
inline Eigen::Quaterniond expOf(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  const double half = 0.5 * angle;
  const double scale = angle > 1e-9 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  const Eigen::Vector3d v = scale * vector;
  return Eigen::Quaterniond(std::cos(half), v.x(), v.y(), v.z());
}

/// Unit quaternion of roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll).
inline Eigen::Quaterniond fromRollPitchYaw(double roll, double pitch, double yaw) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

/// Interpolates two rotations along the shorter way; `share` in [0, 1].
inline Eigen::Quaterniond between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to,
                                  double share) {
  return expOf(share * logOf(to * from.conjugate())) * from;
}

}  // namespace ctrl_more
