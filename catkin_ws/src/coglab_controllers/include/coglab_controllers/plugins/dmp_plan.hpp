/// @file
/// What passes between the requests of the DMP plug-in and its part in the control cycle.
#pragma once

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/goal/goal_gate.hpp"
#include "coglab_controllers/goal/goal_watch.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// How the goal pose of the hand follows from the goal frame.
struct HandGoal {
  Vector3 offset = Vector3::Zero();
  Quaternion orientation = Quaternion::Identity();
  /// m, along which the hand comes to the goal at last, in the goal frame; see CartesianMotion.
  Vector3 approach = Vector3::Zero();
  /// The goal is a frame, with which offset and orientation turn; false: it comes on dmp_goal.
  bool in_goal_frame = true;
  bool keep_orientation = true;  ///< the hand keeps the orientation it has

  /// Where the hand shall be, in dmp_frame_name.
  Pose at(const GoalObservation& goal) const noexcept;
  /// The approach, in dmp_frame_name.
  Vector3 approachAt(const GoalObservation& goal) const noexcept;
};

/// One execute_dmp or switch_dmp, checked and complete.
struct DmpPlan {
  bool execute = true;  ///< false: switch_dmp
  Name primitive;
  CartesianMotionPlan motion;
  HandGoal hand;
  GoalObservation goal;  ///< the goal as it was when the request came
  GoalLimits goal_limits;
  Pose base_from_dmp;  ///< dmp_frame_name in robot_base_frame_name
  bool given = false;  ///< initial_state GIVEN
  Vector3 initial_position = Vector3::Zero(), initial_velocity = Vector3::Zero();
};

}  // namespace coglab_controllers
