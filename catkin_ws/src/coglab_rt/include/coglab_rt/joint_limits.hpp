/// @file
/// The arm's joint limits as read from the one table of them (joint_limits_table.hpp).
#pragma once

#include <array>
#include <string>

#include "coglab_rt/robot_sample.hpp"

namespace coglab_rt {

/// Joints of an arm and their limits, in the order of all joint-space vectors; all vectors hold
/// seven positive finite values, except the positions.
struct JointLimits {
  std::array<std::string, 7> names;  ///< on ROS and in the URDF; each once
  Vector7 lower_position;            ///< rad
  Vector7 upper_position;            ///< rad, above lower_position
  Vector7 velocity;      ///< rad/s, largest to command: the table's over 1 + servo_overshoot
  Vector7 acceleration;  ///< rad/s^2
  Vector7 jerk;          ///< rad/s^3
  Vector7 torque;        ///< Nm
  double position_margin = 0.01;  ///< rad kept free before both ends of every range, by everybody
};

}  // namespace coglab_rt
