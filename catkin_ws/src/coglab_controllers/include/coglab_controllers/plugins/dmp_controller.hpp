/// @file
/// The cognitive controller plug-in (D4.10, section 3.1, Table 4): DMP towards a goal that may
/// move, two-task IK.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/dmp/library.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/names.hpp"
#include "coglab_controllers/plugins/goal_gate.hpp"
#include "coglab_controllers/plugins/goal_source.hpp"
#include "coglab_controllers/plugins/hold.hpp"

namespace coglab_controllers {

/// Arguments of execute_dmp and, without the initial state and the goal frame, of switch_dmp.
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
};

/// Progress of the motion, for dmp/feedback.
struct DmpProgress {
  std::int64_t stamp_ns = 0;
  Name primitive;
  MotionState state = MotionState::Idle;
  Reason reason;
  double phase = 0.0;
  double remaining_distance = 0.0;  ///< m, end-effector to goal as received
  double remaining_time = 0.0;      ///< s
  Pose goal;  ///< of the hand in dmp_frame_name, as estimated, or as latched at the end
};

/// One cycle, for dmp/ik_debug. Poses and vectors in the robot's base frame.
struct IkDebugRecord {
  std::int64_t stamp_ns = 0;
  double phase = 0.0;
  Vector3 goal = Vector3::Zero();
  Pose set_point, measured;
  Vector3 velocity = Vector3::Zero(), angular_velocity = Vector3::Zero();
  IkResult ik;
};

/// How the goal pose of the hand follows from the goal frame; part of a plan.
struct HandGoal {
  Vector3 offset = Vector3::Zero();
  Quaternion orientation = Quaternion::Identity();
  /// The goal is a frame, with which offset and orientation turn; false: it comes on dmp_goal.
  bool in_goal_frame = true;
  bool keep_orientation = true;  ///< the hand keeps the orientation it has
};

/// The plug-in. Requests come from any thread; the cycle sees them as plans.
///
/// Each motion has one owner of its goal, which its request names: the tf2 frame `goal_frame`, or,
/// with an empty one as in D4.10, whoever publishes dmp_goal.
///
/// Parameters: Table 4's `pos_clik_gain`, `rot_clik_gain` (1/s), `robot_base_frame_name`,
/// `dmp_frame_name`, `enable_ik_debug`; and
/// `goal_timeout` (s, dmp_goal; 0: never old), `goal_max_age` (s), `goal_max_jump` (m),
/// `goal_lost_time` (s), `goal_finish_distance` (m), `goal_reach_margin` (m), `goal_time_constant`,
/// `noisy_goal_time_constant` (s), `max_initial_distance` (m), `end_phase`, `end_speed` (m/s),
/// `end_turning` (rad/s), `end_distance` (m), `noisy_end_speed`, `noisy_end_turning`,
/// `noisy_end_distance`, `follow_distance` (m), `follow_time` (s), `arrive_distance` (m), `settle_time` (s),
/// `singularity_threshold`,
/// `rotation_first_scaling`,
/// `hold_blend` (s), `dmp_file` (a library to load at once); on ROS also `goal_tf_frame` (name under
/// which the estimated goal is broadcast; empty: it is not).
class DmpController : public MotionController {
 public:
  DmpController();
  ~DmpController() override;

  /// @name Requests (Table 4), outside the cycle
  /// @{
  Answer loadDmps(const std::string& filename, int& loaded);
  Answer execute(const DmpRequest& request);
  Answer switchDmp(const DmpRequest& request);
  /// dmp_goal. `frame` must be dmp_frame_name. @param stamp_ns on the clock of the samples, 0: now
  /// @param frame_ns the stamp as received, 0: as stamp_ns. Not newer than the last one: refused
  Answer setGoal(const std::string& frame, const Vector3& goal, std::int64_t stamp_ns,
                 std::int64_t frame_ns = 0);
  /// Asks the goal source for the goal frame of the motion; call it often (the ROS side: 200 Hz;
  /// lockstep: every tick).
  void pollGoal();
  /// Who knows frames. Must outlive the controller, or be taken away with null.
  void setGoalSource(GoalSource* source);
  void setIkDebug(bool on) { ik_debug_.store(on, std::memory_order_relaxed); }
  bool ikDebug() const { return ik_debug_.load(std::memory_order_relaxed); }
  /// @}

  /// @name Results, one reader thread each
  /// @{
  bool readProgress(DmpProgress& progress) { return progress_.read(progress); }
  bool readIkDebug(IkDebugRecord& record) { return debug_.pop(record); }
  /// @}

  const std::string& id() const { return setup_.id; }
  const std::string& dmpFrame() const { return dmp_frame_; }
  const std::string& baseFrame() const { return base_frame_; }
  const std::string& goalTfFrame() const { return goal_tf_frame_; }
  /// The motion behind the references. Control thread, or lockstep between two cycles.
  const CartesianMotion& motion() const;

  // MotionController
  void configure(const MotionSetup& setup) override;
  void adopt(const CycleInput& input) override;
  void start(const CycleInput& input) override;
  void stop() override;
  void abort(const Reason& reason) override;
  void computeReference(const CycleInput& input, References& references) override;
  void resolve(const CycleInput& input, References& references) override;
  double limitScale() const override;
  bool waitsAtBorder() const override { return true; }
  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }

 private:
  struct Plan;
  struct Loop;

  Answer request(const DmpRequest& request, bool execute);
  Answer checkRequest(const DmpRequest& request, bool execute, Plan& plan) const;
  Answer findFrames(Plan& plan);
  Answer findGoal(const std::string& frame, Plan& plan);
  Answer findTopicGoal(Plan& plan);
  void followFrom(const std::string& frame, const GoalObservation& first);
  Answer outsideWorkspace(const Plan& plan) const;
  Answer offer(std::unique_ptr<Plan> plan);
  Pose handGoal(const GoalObservation& goal, const HandGoal& hand) const;
  Pose inWorkspace(const Pose& hand_in_dmp, bool& projected) const;

  void begin(const CycleInput& input, const Plan& plan);
  void watchGoal(const CycleInput& input);
  void followEnd(const CycleInput& input);
  void arrive(double dt);
  void closeLoop(const CycleInput& input);
  bool following() const {
    return state_ == MotionState::Running || state_ == MotionState::Holding ||
           (state_ == MotionState::Reached && !resting_);
  }
  void report(const CycleInput& input);

  // set once, by configure()
  MotionSetup setup_;
  std::string base_frame_, dmp_frame_, goal_tf_frame_;
  GoalGateParameters frame_gate_, topic_gate_;
  double arrive_distance_ = 0.01, settle_time_ = 2.0;
  double finish_distance_ = 0.12, reach_margin_ = 0.5, max_initial_distance_ = 0.1;
  std::unique_ptr<TwoTaskIk> ik_;
  std::atomic<bool> ik_debug_{false};

  // requests
  mutable std::mutex library_mutex_;
  Library library_;
  std::unique_ptr<PlanExchange<Plan>> plans_;
  std::mutex goal_mutex_;
  GoalSource* source_ = nullptr;
  std::string frame_of_motion_;  // empty: dmp_goal
  std::uint64_t request_number_ = 0;
  GoalObservation pushed_;      // newest sight of that frame
  GoalObservation topic_goal_;  // newest dmp_goal
  bool topic_goal_known_ = false;
  std::atomic<double> ahead_{0.0};  // s, of the newest goal if it was refused for that
  coglab_rt::TripleBuffer<GoalObservation> goals_;

  // control thread
  MotionState state_ = MotionState::Idle;
  Reason reason_;
  std::unique_ptr<Loop> loop_;
  Hold hold_;
  bool resting_ = true;
  double since_end_ = 0.0;
  coglab_rt::TripleBuffer<DmpProgress> progress_;
  EventRing<IkDebugRecord, 256> debug_;
};

}  // namespace coglab_controllers
