#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "correction.hpp"
#include "ctrl_more/controller_status.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/plugin_library.hpp"
#include "plan.hpp"
#include "shared_records.hpp"
#include "shared_text.hpp"

namespace ctrl_more {

/// One loaded controller in the control cycle: runs it under guard, blends its corrections, and
/// tells the other threads what happened.
///
/// configure() and the const questions are for services; adopt(), run() and judgeTime() are for
/// the cycle and neither allocate nor lock nor throw.
class __attribute__((visibility("hidden"))) ControllerSlot {
 public:
  /// @param instance the controller and its library
  /// @param name its name
  /// @param entry overrun, blend time and fault policy
  /// @param options of the manager
  /// @param owner number for permissions
  ControllerSlot(ControllerInstance instance, const std::string& name,
                 const ControllerEntry& entry, const ManagerOptions& options,
                 std::uint32_t owner);

  /// Gives the controller its configuration, and finds its signals. Throws what initialize()
  /// throws, std::invalid_argument for a description that cannot be run.
  void configure(const GainValues& gains, const SettingValues& settings, RobotStates& robot,
                 ControlStates& control, Logger* logger, const std::atomic<std::uint64_t>* cycle);

  /// Connects Table I's control methods of the instance to its manager.
  void setOwner(ControllerOwner* owner) { instance_.controller->owner_ = owner; }

  const FeedbackController& controller() const { return *instance_.controller; }
  const std::string& library() const;
  Stage stage() const { return stage_; }
  const std::string& name() const { return controller().getName(); }
  const std::vector<ResolvedRobotUse>& robotUses() const { return controller().robot_uses_; }
  const std::vector<ResolvedControlUse>& controlUses() const { return controller().control_uses_; }

  /// @name The cycle
  /// @{
  void adopt(const PlanEntry& entry) noexcept;
  bool idle() const { return activity_ == Activity::Off && !wanted_; }
  void run(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
           ControlStates& control) noexcept;
  /// Judges the duration of the run just made; undoes it if it was an overrun.
  void judgeTime(const Cycle& cycle, std::int64_t duration_ns, ControlStates& control) noexcept;
  /// Test mode: if something it did not declare differs from `before`, restores it and faults.
  void checkUndeclared(const Cycle& cycle, const double* before, ControlStates& control) noexcept;
  bool ran() const { return ran_; }
  /// @}

  /// @name Other threads
  /// @{
  Activity activity() const { return shared_activity_.load(std::memory_order_acquire); }
  FaultKind fault() const { return shared_fault_.load(std::memory_order_acquire); }
  void fillStatus(ControllerStatus& status) const;
  void attribution(const ControlStates& names, std::vector<Attribution>& list) const;
  /// @}

 private:
  struct Written {
    ControlSignal signal;
    int offset;  // in the control buffer
    int local;   // in the slot's buffers
    int size;
    SignalKind kind;
    CorrectionLimit limit;
    StopPolicy on_pause;
    bool limited;  // any finite limit
    bool rated;    // a finite rate limit
  };
  struct Needed {
    RobotSignal signal;
    std::int64_t max_age_ns;
  };

  enum class Why : std::uint8_t { Paused, Fault, Disabled, Stale };

  void start() noexcept;
  void stop(Why why) noexcept;
  void captureCorrection() noexcept;
  void advanceBlend(double dt) noexcept;
  void advanceGains(double dt) noexcept;
  bool isFresh(const Cycle& cycle, const RobotStates& robot) noexcept;
  void runGuarded(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                  ControlStates& control) noexcept;
  FaultKind judgeLimits(const Cycle& cycle, const double* data) noexcept;
  void blendIn(ControlStates& control) noexcept;
  void runStopped(const Cycle& cycle, ControlStates& control) noexcept;
  void openRecord(const Cycle& cycle, const double* data) noexcept;
  FaultKind fillAfter(const double* data) noexcept;
  void restore(double* data) noexcept;
  void undo(const Cycle& cycle, double* data) noexcept;
  void latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept;
  void setActivity(Activity activity) noexcept;
  StopPolicy policyOf(const Written& written) const;

  // What every cycle touches comes first, to lie together in memory.
  FeedbackController* controller_;  // of instance_, at hand
  std::vector<Written> written_;
  std::vector<Needed> needed_;
  std::unique_ptr<SharedRecords> records_;  // [0] cycle, then before and after of each double
  double blend_ = 1.0;
  double gain_weight_ = 1.0;
  std::uint32_t owner_;
  Activity activity_ = Activity::Off;
  bool wanted_ = false;  // enabled, not paused, no fault
  bool reset_pending_ = false;
  bool gains_pending_ = true;
  bool raw_valid_ = false;
  bool ran_ = false;
  bool limited_ = false;  // any signal has a finite limit
  bool enabled_ = false;
  bool paused_ = false;
  Stage stage_ = Stage::Task;
  FaultKind fault_ = FaultKind::None;
  Why why_ = Why::Disabled;

  ControllerInstance instance_;
  double blend_s_;
  std::int64_t overrun_ns_;
  int overruns_to_pause_;
  bool lockstep_;
  StopPolicy on_fault_;
  std::vector<bool> declared_;  // doubles of the control buffer it may change
  std::uint32_t fault_clears_ = 0;
  std::uint32_t resets_ = 0;
  std::uint32_t reorders_ = 0;
  std::uint32_t gains_revision_ = 0;
  int overruns_in_row_ = 0;
  std::vector<double> from_;    // correction that the blend starts from
  std::vector<double> raw_;     // correction of the last run before blending
  std::vector<double> now_;     // room for one correction
  std::vector<double> step_;    // room for another
  std::vector<double> before_;  // room for references
  std::vector<double> after_;   // room for references
  GainValues gains_from_, gains_to_;

  // shared
  std::atomic<Activity> shared_activity_{Activity::Off};
  std::atomic<FaultKind> shared_fault_{FaultKind::None};
  std::atomic<std::uint64_t> fault_cycle_{0};
  std::atomic<std::uint64_t> faults_{0};
  std::atomic<std::uint64_t> overruns_{0};
  std::atomic<std::int64_t> last_ns_{0};
  std::atomic<int> waiting_{-1};
  SharedText fault_text_;
};

}  // namespace ctrl_more
