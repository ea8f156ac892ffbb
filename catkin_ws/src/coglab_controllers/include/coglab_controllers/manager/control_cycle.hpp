/// @file
/// One control cycle: the numbered steps of docs/architecture.md.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/limits/phase_governor.hpp"
#include "coglab_controllers/limits/progress_watch.hpp"
#include "coglab_controllers/manager/feedback_stage.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// How the cycle runs.
struct CycleSettings {
  double cycle_time = 0.005;    ///< intended period, s
  double sample_timeout = 0.1;  ///< a joint state older than this gives zero velocity, s
  double silent_time = 0.5;     ///< no joint state for this long ends a motion, s
  double overrun_time =
      0.004;  ///< a motion controller slower than this overruns, s; 0: not judged (lockstep)
  double blocked_time =
      0.5;  ///< a motion that a limit keeps from any progress for this long ends, s
  int overruns_to_fault = 5;  ///< overruns in a row that fault it
};

/// What the cycle runs: the unit of adoption.
struct CyclePlan {
  MotionController* motion =
      nullptr;  ///< the active motion controller, kept alive by the manager; null: none
  MotionCancel* cancel = nullptr;  ///< its cancels; null only without a motion controller
  Name id;                         ///< its id
};

/// What the manager as a whole does.
enum class ManagerState : std::uint8_t { Idle, Running, Holding, Fault };

/// idle, running, holding or fault.
const char* nameOf(ManagerState state);

/// What the cycle tells the outside world, once per cycle.
struct CycleReport {
  std::uint64_t cycles = 0;      ///< cycles so far, idle ones included
  std::uint64_t samples = 0;     ///< cycles with a new joint state
  std::uint64_t generation = 0;  ///< plan in effect
  Name active;                   ///< id of the active motion controller
  ManagerState state = ManagerState::Idle;
  MotionState motion = MotionState::Idle;
  Reason reason;       ///< why it holds, aborted or is at fault; empty while all is well
  bool fault = false;  ///< the active controller is at fault until switched to again
  /// The set-point of the arm stands: no velocity, no acceleration, and none was asked for by this
  /// cycle and the one before. False without a usable joint state.
  bool standing = false;
  double time_scale = 1.0;                     ///< what the references run at
  double speed_scale = 1.0;                    ///< as requested
  RobotSample robot;                           ///< the joint state used
  JointVector velocity = JointVector::Zero();  ///< as sent, rad/s
  GuardResult guard;                           ///< what step 8 did
  double dt = 0.0;                             ///< of the last cycle with a joint state, s
  double duration = 0.0;                       ///< of the last cycle, s; 0 in lockstep
  double longest = 0.0;                        ///< longest cycle so far, s
  std::uint64_t overruns = 0;                  ///< of motion controllers
  std::uint64_t faults = 0;                    ///< exceptions, NaN, overruns in a row
  std::uint64_t stale = 0;                     ///< cycles whose joint state was not usable
};

/// The control cycle without threads and without ROS. One thread at a time calls run() and idle():
/// no allocation, no lock, no system call, no exception leaves.
class ControlCycle {
 public:
  /// @param robot model, limits, workspace; shared with the controllers
  /// @param feedback the Ctrl-MORE stage with the shared stores; outlives the cycle
  ControlCycle(std::shared_ptr<const RobotSetup> robot, FeedbackStage& feedback,
               const CycleSettings& settings);

  /// A cycle with a new joint state.
  /// @param sample measurement and commanded state
  /// @param dt true time since the last one, s, > 0
  /// @param out velocity to send, stamped with the sample's stamp and epoch; zero when nothing may
  /// move
  void run(const RobotSample& sample, double dt, VelocityCommand& out) noexcept;

  /// A cycle without one: plans are adopted, nothing is computed and nothing sent.
  void idle(std::int64_t now_ns) noexcept;

  /// Plans for the cycle (built by the manager).
  PlanExchange<CyclePlan>& plans() { return plans_; }

  /// How fast references run, 0..1, any thread.
  void setSpeedScale(double scale) { speed_scale_.store(scale, std::memory_order_relaxed); }
  double speedScale() const { return speed_scale_.load(std::memory_order_relaxed); }

  /// Newest report; one reader at a time. Returns whether it is newer than the last one read.
  bool readReport(CycleReport& report) { return reports_.read(report); }

  /// Set while a plug-in's code runs; what a watchdog looks at together with the cycle counter.
  bool inPlugin() const { return in_plugin_.load(std::memory_order_relaxed); }
  /// Counts up at the start of each cycle.
  std::uint64_t heartbeat() const { return heartbeat_.load(std::memory_order_relaxed); }

  const CycleSettings& settings() const { return settings_; }

 private:
  void adopt() noexcept;
  void takeCancel() noexcept;
  bool stands(const RobotSample& sample, const JointVector& velocity) noexcept;
  MotionState motionState() const noexcept;
  bool usable(const RobotSample& sample, double dt) noexcept;
  bool tooSlow(double taken) noexcept;
  void compute(JointVector& velocity) noexcept;
  void watchRobot() noexcept;
  void watchLimits(double dt) noexcept;
  void abortMotion(const Reason& reason) noexcept;
  void fault(const Reason& reason) noexcept;
  void publish(std::int64_t begin_ns) noexcept;
  template <typename Call>
  bool guarded(const char* what, Call&& call) noexcept;

  std::shared_ptr<const RobotSetup> robot_;
  FeedbackStage& feedback_;
  CycleSettings settings_;
  Guard guard_;
  PhaseGovernor governor_;
  ProgressWatch progress_;

  PlanExchange<CyclePlan> plans_;
  std::atomic<double> speed_scale_{1.0};
  std::atomic<bool> in_plugin_{false};
  std::atomic<std::uint64_t> heartbeat_{0};

  // control thread only
  MotionController* motion_ = nullptr;
  MotionCancel* cancel_ = nullptr;
  Name id_;
  CycleInput input_;
  CycleReport report_;
  bool fault_ = false;
  Reason fault_reason_;
  Reason input_reason_;
  double limit_scale_ = 1.0;
  std::uint64_t numbers_ = 0;  // of cycles with a joint state
  bool asked_still_ = false;   // the last cycle with a joint state asked for no velocity
  int overruns_in_row_ = 0;
  int watched_ = 0;  // id of the motion that progress_ watches
  coglab_rt::TripleBuffer<CycleReport> reports_;
};

}  // namespace coglab_controllers
