/// @file
/// What passes between the requests of the DMP plug-in and its part in the control cycle.
#pragma once

#include "coglab_controllers/plugins/dmp_controller.hpp"

namespace coglab_controllers {

/// One execute_dmp or switch_dmp, checked and complete.
struct DmpController::Plan {
  RequestStamp stamp;
  bool execute = true;  ///< false: switch_dmp
  Name primitive;
  CartesianMotionPlan motion;
  HandGoal hand;
  GoalObservation goal;  ///< the goal as it was when the request came
  Pose base_from_dmp;    ///< dmp_frame_name in robot_base_frame_name
  bool given = false;    ///< initial_state GIVEN
  Vector3 initial_position = Vector3::Zero(), initial_velocity = Vector3::Zero();
  Reason refusal;  ///< written by the cycle: why it did not begin; empty: it did
};

/// State of the running motion; the control thread's own.
struct DmpController::Loop {
  Loop() = default;
  Loop(const GoalEstimatorParameters& estimator, const MotionEndParameters& end,
       const GoalGateParameters& goal_gate)
      : motion(estimator, end), gate(goal_gate) {}

  DmpProgress progress(MotionState state, const Reason& reason) const {
    DmpProgress now;
    now.stamp_ns = stamp_ns;
    now.primitive = primitive;
    now.state = state;
    now.reason = reason;
    now.phase = motion.dmp().state().phase;
    now.remaining_distance = remaining_distance;
    now.remaining_time = motion.remainingTime();
    now.goal = {motion.goal(), motion.goalOrientation()};
    return now;
  }

  IkDebugRecord debug(const Pose& measured) const {
    IkDebugRecord now;
    now.stamp_ns = stamp_ns;
    now.phase = motion.dmp().state().phase;
    now.goal = base_from_dmp.position + base_from_dmp.orientation * motion.goal();
    now.set_point = in_base.pose;
    now.velocity = in_base.velocity;
    now.angular_velocity = in_base.angular_velocity;
    now.measured = measured;
    now.ik = ik;
    return now;
  }

  Plan next;  ///< adopted, begins with the next joint state
  bool pending = false;
  bool was_following = false;  ///< the motion that `next` replaces still has its loop closed
  CartesianMotion motion;
  GoalGate gate;
  CartesianMotionPlan plan;
  HandGoal hand;
  Name primitive;
  Pose base_from_dmp, dmp_from_base;
  Pose goal;                     ///< of the hand, in dmp_frame_name, inside the workspace
  CartesianReference reference;  ///< in dmp_frame_name
  CartesianReference in_base;
  StartBlend blend;
  IkResult ik;
  std::uint64_t request = 0;
  std::int64_t stamp_ns = 0;
  double remaining_distance = 0.0;
  bool projected = false;
  bool ended = false;      ///< the set-point has arrived
  double settling = 0.0;   ///< s since then that the hand has not
};

}  // namespace coglab_controllers
