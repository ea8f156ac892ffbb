/// @file
/// The cognitive controller plug-in (D4.10, section 3.1, Table 4): a DMP towards a goal that may
/// move, with two-task IK.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "coglab_controllers/dmp/library.hpp"
#include "coglab_controllers/goal/goal_input.hpp"
#include "coglab_controllers/motion/motion_runner.hpp"
#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_controllers/plugins/dmp_cycle.hpp"

namespace coglab_controllers {

/// Handles the requests of the plug-in, from any thread. An accepted request becomes a DmpPlan,
/// which the cycle runs (DmpCycle). A newer request replaces the running motion.
///
/// Each motion has one source of its goal: the tf2 frame `goal_frame` of its request, or the topic
/// dmp_goal if `goal_frame` is empty, as in D4.10.
///
/// Parameters: Table 4's `pos_clik_gain`, `rot_clik_gain` (1/s), `robot_base_frame_name`,
/// `dmp_frame_name`, `enable_ik_debug`; and
/// `goal_timeout` (s, dmp_goal; 0: never old), `goal_max_age` (s), `goal_max_jump` (m),
/// `goal_lost_time` (s), `goal_finish_distance` (m), `goal_reach_margin` (m), `goal_time_constant`,
/// `noisy_goal_time_constant` (s), `goal_max_speed`, `predicted_goal_speed` (m/s),
/// `predicted_goals` (name suffix of frames that are predicted rest positions),
/// `max_initial_distance` (m), `max_scale` (largest distance of a goal, in distances of the
/// demonstration), `end_phase`, `end_speed` (m/s), `end_turning` (rad/s),
/// `end_distance` (m), `follow_distance` (m), `follow_time` (s), `arrive_distance` (m),
/// `settle_time` (s), `correction_speed` (m/s), `singularity_threshold`,
/// `rotation_first_scaling`, `hold_blend` (s), `dmp_file` (a library to load at the start); on ROS
/// also `goal_tf_frame` (tf2 frame of the estimated goal; empty: not broadcast).
class DmpController : public MotionRunner<DmpPlan> {
 public:
  DmpController();

  /// @name Requests (Table 4), outside the cycle
  /// @{
  Answer loadDmps(const std::string& filename, int& loaded);
  Answer execute(const DmpRequest& request) { return ask(request, true); }
  Answer switchDmp(const DmpRequest& request) { return ask(request, false); }
  /// Predicts the result of execute() now, from the commanded posture at rest. The checks are those
  /// of execute(), but no motion begins, and the controller need not be active.
  Answer predict(const DmpRequest& request, PredictedPath& path);
  /// Receives a goal from dmp_goal, see GoalInput::offer(). `frame` must be dmp_frame_name.
  Answer setGoal(const std::string& frame, const Vector3& goal, std::int64_t stamp_ns,
                 std::int64_t frame_ns = 0) {
    return goals_.offer(frame, goal, stamp_ns, frame_ns);
  }
  /// Looks up the goal frame of the motion in the goal source. Call it often (ROS side: 200 Hz;
  /// lockstep: every tick).
  void pollGoal() { goals_.poll(); }
  /// Sets the source of frame poses. It outlives the controller, or is removed with null.
  void setGoalSource(GoalSource* source) { goals_.setSource(source); }
  void setIkDebug(bool on) { ik_debug_.store(on, std::memory_order_relaxed); }
  bool ikDebug() const { return ik_debug_.load(std::memory_order_relaxed); }
  /// @}

  /// @name Results, one reader thread each
  /// @{
  bool readProgress(DmpProgress& progress) { return progress_.read(progress); }
  bool readIkDebug(IkDebugRecord& record) { return debug_.pop(record); }
  /// Requests the path of the running motion; readPath() returns it after the motion's next cycle.
  void askPath() { snapshots_.ask(); }
  /// Rolls out the motion, in dmp_frame_name. False if there is no new path since the last call.
  bool readPath(PredictedPath& path);
  /// @}

  const std::string& dmpFrame() const { return dmp_frame_; }
  const std::string& baseFrame() const { return base_frame_; }
  const std::string& goalTfFrame() const { return goal_tf_frame_; }
  /// The motion behind the references. Control thread, or lockstep between two cycles.
  const CartesianMotion& motion() const { return cycle_->motion(); }

  // MotionController
  void configure(const MotionSetup& setup) override;
  void resolve(const CycleInput& input, References& references) override;

 private:
  // MotionRunner
  Reason unwelcome(const DmpPlan& plan) const override;
  void report(std::int64_t stamp_ns) override;

  Answer ask(const DmpRequest& request, bool execute);
  Answer makePlan(const DmpRequest& request, bool execute, DmpPlan& plan);
  Answer checkReach(const DmpPlan& plan) const;
  Answer rollOutPlan(const DmpPlan& plan, bool at_rest, PredictedPath& path);
  Reason scaledTooFar(const DmpPlan& plan, const Vector3& start, const Vector3& goal) const;
  Answer checkPath(const DmpPlan& plan, const Vector3& hand, const TimedPath& path) const;

  // set once, by configure()
  std::string base_frame_, dmp_frame_, goal_tf_frame_;
  std::string predicted_;  // name suffix of frames that are predicted rest positions
  double reach_margin_ = 0.5, max_initial_distance_ = 0.1, max_scale_ = 5.0;
  double arrive_distance_ = 0.01;

  mutable std::mutex library_mutex_;
  Library library_;
  GoalInput goals_;
  DmpCycle* const cycle_;  // the motion that the base runs
  std::mutex predict_mutex_;
  Tunables not_offered_;  // of the next one
  DmpCycle imagined_;     // begins motions only for prediction
  CopyOnRequest<DmpSnapshot> snapshots_;
  std::atomic<bool> ik_debug_{false};
  TripleBuffer<DmpProgress> progress_;
  EventRing<IkDebugRecord, 256> debug_;
};

}  // namespace coglab_controllers
