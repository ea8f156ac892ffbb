/// @file
/// Reads the settings of the controller manager from ROS parameters.
#pragma once

#include <string>

#include <ros/node_handle.h>

#include "coglab_controllers/manager/controller_manager.hpp"

namespace coglab_controllers {

/// Reads the table of joint limits given by the parameters `joint_limits_file` and
/// `joint_limits_profile` below `node`.
coglab_rt::JointLimits readJointLimits(const ros::NodeHandle& node);

/// Settings of the controller manager from the parameters below `node`: those of
/// readManagerSettings(), and `joint_limits_file`, `joint_limits_profile`, `urdf_file` (else the
/// parameter robot_description, else lwr_description's own file). `feedback_file` may be
/// `package://name/path`; other relative names refer to this package's config folder.
/// @throws std::runtime_error naming the parameter
ManagerSettings readManagerSettings(const ros::NodeHandle& node);

}  // namespace coglab_controllers
