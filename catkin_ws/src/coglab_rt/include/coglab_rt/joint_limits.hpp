/// @file
/// The joint limits of an arm, as read from their table (joint_limits_table.hpp).
#pragma once

#include <array>
#include <string>

#include "coglab_rt/robot_sample.hpp"

namespace coglab_rt {

/// Joints of an arm and their limits, in the order of all joint-space vectors. All vectors contain
/// seven positive finite values, except the positions.
struct JointLimits {
  std::array<std::string, 7> names;  ///< in ROS and in the URDF; all different
  Vector7 lower_position;            ///< rad
  Vector7 upper_position;            ///< rad, above lower_position
  Vector7 velocity;      ///< rad/s, largest commanded: the table's divided by 1 + servo_overshoot
  Vector7 acceleration;  ///< rad/s^2
  Vector7 jerk;          ///< rad/s^3
  Vector7 torque;        ///< Nm
  double position_margin = 0.01;  ///< rad that every component keeps from both ends of every range
};

}  // namespace coglab_rt
