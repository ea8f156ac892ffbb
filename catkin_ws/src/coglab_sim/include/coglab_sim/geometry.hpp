/// @file
/// Vectors, poses and wrenches of the simulated cell. The world axes are those of `lwr_base_link`.
/// All units are SI.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "coglab_rt/robot_sample.hpp"

namespace coglab_sim {

using coglab_rt::Vector6;  ///< Fx Fy Fz Tx Ty Tz, or vx vy vz wx wy wz
using coglab_rt::Vector7;  ///< joints in wire order A1 A2 E1 A3 A4 A5 A6
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Matrix67 = Eigen::Matrix<double, 6, 7>;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Seven numbers, one per joint in wire order.
inline Vector7 joints(double a1, double a2, double e1, double a3, double a4, double a5, double a6) {
  return (Vector7() << a1, a2, e1, a3, a4, a5, a6).finished();
}

/// Position and orientation of a frame in another one.
struct Pose {
  Vector3d position = Vector3d::Zero();            ///< m
  Quaterniond rotation = Quaterniond::Identity();  ///< unit length

  Pose operator*(const Pose& other) const {
    return {position + rotation * other.position, rotation * other.rotation};
  }
  Vector3d operator*(const Vector3d& point) const { return position + rotation * point; }
  Pose inverse() const {
    const Quaterniond back = rotation.conjugate();
    return {-(back * position), back};
  }
};

/// Linear and angular velocity of a frame, world axes.
struct Twist {
  Vector3d linear = Vector3d::Zero();   ///< m/s, of the frame's origin
  Vector3d angular = Vector3d::Zero();  ///< rad/s

  /// Velocity of a point that moves with the frame; `arm` is the vector from the frame's origin to
  /// the point.
  Vector3d at(const Vector3d& arm) const { return linear + angular.cross(arm); }
};

/// Force and torque about a stated point, world axes.
struct Wrench {
  Vector3d force = Vector3d::Zero();   ///< N
  Vector3d torque = Vector3d::Zero();  ///< Nm

  /// Adds a force `f` that acts at `arm` (m) from the reference point.
  void add(const Vector3d& f, const Vector3d& arm) {
    force += f;
    torque += arm.cross(f);
  }
  Vector6 stacked() const {
    Vector6 both;
    both << force, torque;
    return both;
  }
};

/// Rotation vector (rad) of the shortest rotation from `from` to `to`, in their common axes.
inline Vector3d rotationBetween(const Quaterniond& from, const Quaterniond& to) {
  Quaterniond difference = to * from.conjugate();
  if (difference.w() < 0.0) difference.coeffs() = -difference.coeffs();
  const double sine = difference.vec().norm();
  if (sine < 1e-12) return 2.0 * difference.vec();
  return difference.vec() * (2.0 * std::atan2(sine, difference.w()) / sine);
}

}  // namespace coglab_sim
