/// @file
/// A request for a DMP motion, as execute_dmp and switch_dmp have it, and the plan that the control
/// cycle gets of it.
#pragma once

#include <string>

#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/goal/goal_limits.hpp"
#include "coglab_controllers/names.hpp"

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
  double arrival_speed = 0.0;  ///< m/s, see DmpPlan
  GoalBounds goal_limits;      ///< where that frame may go; else the motion ends
};

/// Refuses a request with numbers that are not finite or out of range.
/// @param execute false: switch_dmp, without an initial state
Answer check(const DmpRequest& request, bool execute);

/// A request that was checked, complete and of fixed size: built outside the control cycle, copied
/// into it.
struct DmpPlan {
  Dmp dmp;             ///< the primitive
  double ratio = 1.0;  ///< dmp_ratio
  bool orientation_control = true;
  /// m/s at which the hand comes to the goal at last; 0: as the primitive has it.
  /// Within kSlowWay of the goal it is not faster, before that only so much that it brakes by
  /// kGentleBraking until there; the clock of the primitive is slowed for that, its path stays.
  double arrival_speed = 0.0;
  /// The goal tells where something will come to rest. It moves because the prediction changes,
  /// which is not followed like a goal that moves; see GoalFilterParameters::predicted_speed.
  bool predicted = false;

  bool execute = true;  ///< false: switch_dmp
  Name primitive{};
  bool given = false;  ///< initial_state GIVEN
  Vector3 initial_position = Vector3::Zero(), initial_velocity = Vector3::Zero();

  /// How the goal pose of the hand follows from the goal frame.
  Vector3 offset = Vector3::Zero();
  Quaternion orientation = Quaternion::Identity();
  Vector3 approach = Vector3::Zero();  ///< m, in the goal frame, see CartesianMotion::step
  /// The goal is a frame, with which offset and orientation turn; false: it comes on dmp_goal.
  bool in_goal_frame = true;
  bool keep_orientation = true;  ///< the hand keeps the orientation it has

  GoalObservation goal{};  ///< the goal as it was when the request came
  GoalBounds goal_limits{};
  Pose base_from_dmp{};  ///< dmp_frame_name in robot_base_frame_name

  /// Where the hand shall be, in dmp_frame_name.
  Pose handAt(const GoalObservation& seen) const noexcept;
  /// The approach, in dmp_frame_name.
  Vector3 approachAt(const GoalObservation& seen) const noexcept {
    return in_goal_frame ? Vector3(seen.orientation * approach) : approach;
  }
};

}  // namespace coglab_controllers
