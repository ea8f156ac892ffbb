/// @file
/// Fixed-size types of this package. Units are SI. The joints are in wire order: lwr_a1 lwr_a2
/// lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace coglab_controllers {

/// Largest number of joints of a chain. A chain with fewer leaves the last entries zero.
constexpr int kMaxJoints = 7;

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;
/// rad or rad/s; the same type as coglab_rt::Vector7.
using JointVector = Eigen::Matrix<double, kMaxJoints, 1>;
/// One column per joint; columns beyond the chain's joints are zero.
using Matrix37 = Eigen::Matrix<double, 3, kMaxJoints>;
/// Rows 0-2 translation (m/rad), rows 3-5 rotation (rad/rad), eq. (8).
using Jacobian = Eigen::Matrix<double, 6, kMaxJoints>;

/// Pose of the end-effector in the base frame.
struct Pose {
  Vector3 position = Vector3::Zero();               ///< m
  Quaternion orientation = Quaternion::Identity();  ///< unit
};

/// Reference of a Cartesian motion for the inverse kinematics in one cycle.
///
/// The pose is the desired one *now*, at the time of the joint measurement. The velocities are the
/// mean velocities from it to the desired pose at the end of the cycle. So an ideal robot has no
/// tracking error, and eq. (6)-(7) close the loop on a true error.
struct CartesianReference {
  Pose pose;
  Vector3 velocity = Vector3::Zero();          ///< m/s
  Vector3 angular_velocity = Vector3::Zero();  ///< rad/s, base frame
  bool orientation_control = true;             ///< false: the orientation is free
};

}  // namespace coglab_controllers
