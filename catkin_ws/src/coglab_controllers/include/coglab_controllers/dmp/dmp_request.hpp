/// @file
/// A request for a DMP motion (services execute_dmp and switch_dmp), and the plan that the control
/// cycle receives.
#pragma once

#include <string>

#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/goal/goal_limits.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// The fields of execute_dmp, with the same names. switch_dmp has no initial state and no
/// goal_frame: both stay as they are.
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
  std::string goal_frame;       ///< tf2 frame that the motion follows; empty: topic dmp_goal
  Vector3 goal_approach =
      Vector3::Zero();         ///< m, vector of the final approach, same frame as goal_offset
  double arrival_speed = 0.0;  ///< m/s, see DmpPlan
  GoalBounds goal_limits;      ///< bounds of the goal; outside, the motion ends
};

/// Refuses a request with a number that is not finite or is out of range.
/// @param execute false: switch_dmp, without an initial state
Answer check(const DmpRequest& request, bool execute);

/// A checked, complete request of fixed size. It is built outside the control cycle and copied into
/// it.
struct DmpPlan {
  Dmp dmp;             ///< the primitive
  double ratio = 1.0;  ///< dmp_ratio
  bool orientation_control = true;
  /// Largest speed of the hand within kSlowWay of the goal, m/s; 0: the primitive's own speed.
  /// Further away, the hand can brake to it with kGentleBraking. Only the clock of the primitive
  /// slows down; the path stays the same.
  double arrival_speed = 0.0;
  /// true: the goal is a predicted rest position. It moves only because the prediction changes, so
  /// slow changes give no goal velocity; see GoalFilterParameters::predicted_speed.
  bool predicted = false;

  bool execute = true;  ///< false: switch_dmp
  Name primitive{};
  bool given = false;  ///< initial_state GIVEN
  Vector3 initial_position = Vector3::Zero(), initial_velocity = Vector3::Zero();

  /// Goal pose of the hand relative to the goal frame.
  Vector3 offset = Vector3::Zero();
  Quaternion orientation = Quaternion::Identity();
  Vector3 approach = Vector3::Zero();  ///< m, in the goal frame, see CartesianMotion::step
  /// true: the goal is a frame; offset and orientation turn with it. false: topic dmp_goal.
  bool in_goal_frame = true;
  bool keep_orientation = true;  ///< the hand keeps its present orientation

  GoalObservation goal{};  ///< goal at the time of the request
  GoalBounds goal_limits{};
  Pose base_from_dmp{};  ///< pose of dmp_frame_name in robot_base_frame_name

  /// Goal pose of the hand, in dmp_frame_name.
  Pose handAt(const GoalObservation& seen) const noexcept;
  /// The approach, in dmp_frame_name.
  Vector3 approachAt(const GoalObservation& seen) const noexcept {
    return in_goal_frame ? Vector3(seen.orientation * approach) : approach;
  }
};

}  // namespace coglab_controllers
