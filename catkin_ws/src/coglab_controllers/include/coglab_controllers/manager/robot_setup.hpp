/// @file
/// Robot data that the manager and all controllers share: chain, limits and frames.
#pragma once

#include <memory>
#include <string>

#include "coglab_controllers/kinematics/chain.hpp"
#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/manager/parameters.hpp"
#include "coglab_rt/joint_limits.hpp"

namespace coglab_controllers {

/// Immutable after load; shared by the cycle and the controllers.
struct RobotSetup {
  Chain chain;                    ///< base link to tool link
  coglab_rt::JointLimits limits;  ///< with the parameters of Table 6 applied
  GuardParameters guard;          ///< limits of step 8
  Workspace workspace;            ///< for goals
  Quaternion tool_from_wrench;    ///< orientation of the measured wrench's frame in the tool
  std::string tool_link;          ///< name of the chain's end
  std::string touch_topic;        ///< of the hand's touch sensors; empty: it has none
};

/// Builds the setup from the robot's model, its table of limits, and the manager's parameters
/// (D4.10 Table 6): `base_link` (lwr_base_link), `tool_link` (ih2_palm), `wrench_link` (ih2_palm;
/// the same as the bridge's `tool_frame`), `upper_joint_pos_limit`, `lower_joint_pos_limit`,
/// `joint_vel_limit` (rad, rad, rad/s; seven each, wire order; default: the table),
/// `position_margin` (rad), `hand_speed_limit`, `elbow_speed_limit` (m/s; 0: none), block
/// `workspace`: `box_min`, `box_max`, `base_centre` (m), `base_radius` (m), `max_stretch` (share of
/// the reach), `deceleration` (m/s^2); `tactile` (false: the hand has no touch
/// sensors) and their `tactile_topic` (ih2_hand/fingertip_forces).
/// @param urdf text of the model
/// @throws std::runtime_error or std::invalid_argument naming the parameter, link or joint
std::shared_ptr<const RobotSetup> makeRobotSetup(const std::string& urdf,
                                                 const coglab_rt::JointLimits& table,
                                                 const Parameters& parameters);

}  // namespace coglab_controllers
