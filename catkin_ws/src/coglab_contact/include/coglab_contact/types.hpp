/// @file
/// Fixed-size types of this package. Units are SI, joints in wire order.
#pragma once

#include <functional>

#include <Eigen/Core>

namespace coglab_contact {

using Vector3 = Eigen::Vector3d;
/// One number per joint of the arm.
using Joints = Eigen::Matrix<double, 7, 1>;
/// The palm's Jacobian for translation, m/rad, base frame.
using PalmJacobian = Eigen::Matrix<double, 3, 7>;
/// Converts joint positions (rad) to the palm's Jacobian.
using JacobianAt = std::function<PalmJacobian(const Joints&)>;

/// s, averaging time of measurements at rest, at any sample period. A push of this length still
/// counts.
constexpr double kRemembered = 0.25;

}  // namespace coglab_contact
