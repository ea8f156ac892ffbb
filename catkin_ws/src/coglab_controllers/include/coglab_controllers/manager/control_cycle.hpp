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

/// Settings of the cycle.
struct CycleSettings {
  double cycle_time = 0.005;    ///< intended period, s
  double sample_timeout = 0.1;  ///< s; an older joint state gives zero velocity
  double silent_time = 0.5;     ///< s without a joint state after which a motion ends
  double overrun_time =
      0.004;                  ///< s; a slower motion controller overruns; 0: not checked (lockstep)
  double blocked_time = 0.5;  ///< s without progress because of a limit, after which a motion ends
  int overruns_to_fault = 5;  ///< overruns in a row after which the controller is at fault
};

/// Plan that the cycle adopts as a whole.
struct CyclePlan {
  MotionController* motion =
      nullptr;  ///< the active motion controller, kept alive by the manager; null: none
  MotionCancel* cancel = nullptr;  ///< cancels of `motion`; null only without a motion controller
  Name id;                         ///< id of `motion`
};

/// State of the manager.
enum class ManagerState : std::uint8_t { Idle, Running, Holding, Fault };

/// Returns idle, running, holding or fault.
const char* nameOf(ManagerState state);

/// Report of the cycle, written once per cycle.
struct CycleReport {
  std::uint64_t cycles = 0;      ///< number of cycles, with idle ones
  std::uint64_t samples = 0;     ///< number of cycles with a new joint state
  std::uint64_t generation = 0;  ///< plan in effect
  Name active;                   ///< id of the active motion controller
  ManagerState state = ManagerState::Idle;
  MotionState motion = MotionState::Idle;
  Reason reason;       ///< of holding, abort, fault, or a speed limit of 0; else empty
  bool fault = false;  ///< the active controller is at fault until it is switched to again
  /// True if the set-point of the arm stands: no velocity, no acceleration, and zero velocity was
  /// sent in this cycle and the one before. False without a usable joint state.
  bool standing = false;
  double time_scale = 1.0;                     ///< clock rate of the references, 0..1
  double speed_scale = 1.0;                    ///< as requested
  RobotSample robot;                           ///< the joint state used
  JointVector velocity = JointVector::Zero();  ///< as sent, rad/s
  GuardResult guard;                           ///< result of step 8
  double dt = 0.0;                             ///< of the last cycle with a joint state, s
  double duration = 0.0;                       ///< of the last cycle, s; 0 in lockstep
  double longest = 0.0;                        ///< longest cycle so far, s
  std::uint64_t overruns = 0;                  ///< of motion controllers
  std::uint64_t faults = 0;                    ///< exceptions, NaN, overruns in a row
  std::uint64_t stale = 0;                     ///< number of cycles without a usable joint state
};

/// The control cycle without threads and without ROS. One thread at a time calls run() and idle().
/// They do not allocate, lock, call the system or throw.
class ControlCycle {
 public:
  /// @param robot model, limits, workspace; shared with the controllers
  /// @param feedback the Ctrl-MORE stage with the shared stores; outlives the cycle
  ControlCycle(std::shared_ptr<const RobotSetup> robot, FeedbackStage& feedback,
               const CycleSettings& settings);

  /// Runs a cycle with a new joint state.
  /// @param sample measurement and commanded state
  /// @param dt true time since the last one, s, > 0
  /// @param out velocity to send, with the sample's stamp and epoch; zero if no motion is allowed
  void run(const RobotSample& sample, double dt, VelocityCommand& out) noexcept;

  /// Runs a cycle without a joint state: adopts plans, but computes and sends nothing.
  void idle(std::int64_t now_ns) noexcept;

  /// Plans for the cycle; the manager builds them.
  PlanExchange<CyclePlan>& plans() { return plans_; }

  /// Sets the clock rate of the references, 0..1. Any thread.
  void setSpeedScale(double scale) { speed_scale_.store(scale, std::memory_order_relaxed); }
  double speedScale() const { return speed_scale_.load(std::memory_order_relaxed); }

  /// Reads the newest report; returns true if it is newer than the last one read. One reader.
  bool readReport(CycleReport& report) { return reports_.read(report); }

  /// True while code of a plug-in runs. A watchdog reads it together with heartbeat().
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
  double speed_limit_ = 0.0;   // of the managers in this cycle, m/s
  std::uint64_t numbers_ = 0;  // number of cycles with a joint state
  bool cancelled_ = false;     // a cancel came, and no motion since
  bool asked_still_ = false;   // the last cycle with a joint state sent zero velocity
  int overruns_in_row_ = 0;
  int watched_ = 0;  // id of the motion that progress_ watches
  coglab_rt::TripleBuffer<CycleReport> reports_;
};

}  // namespace coglab_controllers
