/// @file
/// A request for a DMP motion, as execute_dmp and switch_dmp have it.
#pragma once

#include <string>

#include "coglab_controllers/goal/goal_watch.hpp"

namespace coglab_controllers {

/// The fields of execute_dmp, with their names. switch_dmp has no initial state and no goal_frame:
/// it leaves both as they are.
struct DmpRequest {
  static constexpr int kCurrent = 0, kGiven = 1;  ///< initial_state

  std::string primitive_id;
  int initial_state = kCurrent;
  Vector3 initial_position = Vector3::Zero();  ///< m, in dmp_frame_name; only with kGiven
  Vector3 initial_velocity = Vector3::Zero();  ///< m/s
  double dmp_ratio = 1.0;
  Vector3 goal_offset = Vector3::Zero();  ///< m, in the goal frame, or dmp_frame_name (dmp_goal)
  bool orientation_control = false;
  Eigen::Vector4d target_orientation =
      Eigen::Vector4d::Zero();  ///< x y z w; all zero: keep the current one
  std::string goal_frame;  ///< tf2 frame that the motion follows; empty: what comes on dmp_goal
  Vector3 goal_approach =
      Vector3::Zero();         ///< m, along which the hand comes at last, as the offset
  double arrival_speed = 0.0;  ///< m/s, as of CartesianMotionPlan
  GoalLimits goal_limits;      ///< what that frame may do, or the motion ends
};

}  // namespace coglab_controllers
