/// @file
/// Part of the DMP plug-in that runs in the control cycle: eq. (1)-(5) towards a goal that may
/// move, jump or vanish.
#pragma once

#include <cstdint>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/goal/goal_input.hpp"
#include "coglab_controllers/motion/motion.hpp"
#include "coglab_controllers/motion/reference_loop.hpp"

namespace coglab_controllers {

/// Progress of the motion, for dmp/feedback.
struct DmpProgress {
  std::int64_t stamp_ns = 0;
  Name primitive;
  MotionState state = MotionState::Idle;
  Reason reason;
  double phase = 0.0;
  double remaining_distance = 0.0;  ///< m, end-effector to goal as received
  double remaining_time = 0.0;      ///< s
  Pose goal;  ///< of the hand in dmp_frame_name: estimated, or latched at the end
};

/// Data of one cycle, for dmp/ik_debug. Poses and vectors in the robot's base frame.
struct IkDebugRecord {
  std::int64_t stamp_ns = 0;
  double phase = 0.0;
  Vector3 goal = Vector3::Zero();
  Quaternion goal_orientation = Quaternion::Identity();
  Pose set_point, measured;
  Vector3 velocity = Vector3::Zero(), angular_velocity = Vector3::Zero();
  IkResult ik;
};

/// Present state of a motion, to roll out the rest of it.
struct DmpSnapshot {
  std::int64_t stamp_ns = 0;
  Name primitive;
  CartesianMotion motion;
  Pose goal;  ///< of the hand in dmp_frame_name, as received, inside the workspace
  Vector3 approach = Vector3::Zero();  ///< see CartesianMotion::step
};

/// Stage of a DMP motion.
enum class DmpStage : std::uint8_t {
  Rest,    ///< no motion
  Travel,  ///< the set-point moves to the goal
  Arrive,  ///< the set-point is at the goal, the hand not yet
  Settle,  ///< reached; the hand comes to rest
  Watch,   ///< reached, the arm stands; a goal that leaves its ball is followed again
  GivenUp  ///< aborted, with a reason
};

/// Real-time part of the plug-in. Parameters for goal (GoalFrameLimits), filter and end
/// (MotionEndParameters): see the list at DmpController.
class DmpCycle : public Motion<DmpPlan> {
 public:
  /// @param goals outlives this object
  explicit DmpCycle(GoalInput& goals) : goals_(goals) {}

  void configure(MotionConfiguration& configuration) override;
  void start(const MotionStart<DmpPlan>& start) override;
  void computeReference(const MotionCycle& cycle, MotionReference& reference) override;
  MotionState state() const override;
  const Reason& reason() const override { return reason_; }
  void stop() noexcept override;
  bool endIfThere(const CycleInput& input) override;

  DmpStage stage() const noexcept { return stage_; }
  /// The arm follows the set-point.
  bool loopClosed() const noexcept {
    return stage_ == DmpStage::Travel || stage_ == DmpStage::Arrive || stage_ == DmpStage::Settle;
  }
  const CartesianMotion& motion() const noexcept { return motion_; }
  DmpProgress progress(std::int64_t stamp_ns, MotionState state, const Reason& reason) const;
  IkDebugRecord debug(const CycleInput& input, const IkResult& ik) const;
  DmpSnapshot snapshot(std::int64_t stamp_ns) const {
    return {stamp_ns, plan_.primitive, motion_, goal_, plan_.approachAt(limits_.goal())};
  }

 private:
  void execute(const MotionStart<DmpPlan>& start);
  void substitute(const DmpPlan& plan);
  Pose inWorkspace(const Pose& hand_in_dmp, bool& projected) const;
  void watchGoal(const CycleInput& input);
  void judgeGoal();
  void comeToRest(const IkResult& last);
  void followEnd(const MotionCycle& cycle);
  void giveUp(const Reason& why) noexcept;
  void write(MotionReference& reference, double dt);

  GoalInput& goals_;

  // set once, by configure()
  std::shared_ptr<const RobotSetup> robot_;
  // null if the filter of the goal is off
  Tunable *time_constant_ = nullptr, *noisy_time_constant_ = nullptr, *max_goal_speed_ = nullptr;
  GoalFrameLimits frame_limits_, topic_limits_;
  double arrive_distance_ = 0.01, finish_distance_ = 0.12;

  DmpStage stage_ = DmpStage::Rest;
  Reason reason_;
  DmpPlan plan_;  // of the running motion, with the changes of switch_dmp
  CartesianMotion motion_;
  GoalLimits limits_;
  Pose dmp_from_base_;
  Pose goal_;                     // of the hand, in dmp_frame_name, inside the workspace
  CartesianReference reference_;  // in dmp_frame_name
  CartesianReference in_base_;
  double remaining_distance_ = 0.0;
  bool projected_ = false;  // the goal is outside the workspace
  bool jumps_ = false;      // the motion does not begin at the arm's position
  Arrival arrival_;
  double since_reached_ = 0.0;  // s
};

}  // namespace coglab_controllers
