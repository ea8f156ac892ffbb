#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "coglab_rt/fixed_text.hpp"
#include "coglab_rt/triple_buffer.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/controller_instance.hpp"
#include "ctrl_more/manager/controller_status.hpp"
#include "manager/guard.hpp"
#include "manager/plan.hpp"

namespace ctrl_more {

/// Shared data of the controllers of one stage while they run one after another.
struct StageRun {
  const Cycle& cycle;
  const RobotStates& robot;
  const ControlStates& original;  ///< references before the stage
  ControlStates& control;
  std::vector<double>* compared;  ///< test mode: buffer for all of `control`; else null
  bool timed;
  bool let_go;               ///< see FeedbackControllersManager::letGo()
  unsigned buffer;           ///< the cycle's buffer of records
  std::int64_t boundary_ns;  ///< steady clock between the last controller and this one
};

/// One loaded controller in the control cycle. Runs it with a guard, blends its corrections, and
/// publishes its state for other threads.
///
/// A controller writes to the references directly. Its writes are checked, then undone or blended.
/// The references before and after it are recorded for attribution and for the next fade.
///
/// Services call configure() and the const queries. The cycle calls adopt() and run(), which do not
/// allocate, lock or throw.
class Slot {
 public:
  /// @param instance the controller and its library
  /// @param name its name
  /// @param entry overrun, blend time and fault policy
  /// @param options options of the manager
  /// @param owner number for permissions
  Slot(ControllerInstance instance, const std::string& name, const ControllerEntry& entry,
       const ManagerOptions& options, std::uint32_t owner);

  /// Configures the controller and finds its signals. Throws the exceptions of initialize(), and
  /// std::invalid_argument for an invalid description.
  void configure(const GainValues& gains, const SettingValues& settings, RobotStates& robot,
                 ControlStates& control, Logger* logger, const std::atomic<std::uint64_t>* cycle);

  /// Connects Table I's control methods of the instance to its manager.
  void setOwner(ControllerOwner* owner) { controller_.owner_ = owner; }

  const FeedbackController& controller() const { return controller_; }
  Stage stage() const { return stage_; }
  const std::string& name() const { return controller_.getName(); }
  const std::vector<ResolvedRobotUse>& robotUses() const { return controller_.robot_uses_; }
  const std::vector<ResolvedControlUse>& controlUses() const { return controller_.control_uses_; }

  /// @name The cycle
  /// @{
  void adopt(const PlanEntry& entry) noexcept;
  /// Runs one cycle.
  void run(StageRun& run) noexcept;
  /// @}

  /// @name Other threads
  /// @{
  Activity activity() const { return shared_activity_.load(std::memory_order_acquire); }
  FaultKind fault() const { return shared_fault_.load(std::memory_order_acquire); }
  void fillStatus(ControllerStatus& status) const;
  /// Adds its changes and its state in the newest complete cycle.
  /// @param names store for the names of signals
  /// @param buffer the reader's buffer of records
  /// @param record record with its cycle number; data of other cycles are omitted
  void addRecord(const ControlStates& names, unsigned buffer, CycleRecord& record) const;
  /// True if the duration of its update() is checked.
  bool isTimed() const { return overrun_ns_ > 0 && !lockstep_; }
  /// @}

 private:
  /// Record of one cycle.
  struct Record {
    bool any = false;
    std::uint64_t cycle = 0;
    std::vector<double> before, after, state;
  };
  struct Needed {
    RobotSignal signal;
    std::int64_t max_age_ns;
  };
  enum class Why : std::uint8_t { Paused, Fault, Disabled, Stale };

  void start() noexcept;
  void stop(Why why) noexcept;
  void captureCorrection() noexcept;
  void lastCorrection(double* correction) noexcept;
  void advanceBlend(double dt) noexcept;
  void advanceGains(double dt) noexcept;
  bool findStale(const StageRun& run) noexcept;
  void runActive(StageRun& run) noexcept;
  FaultKind callController(StageRun& run);
  void runStopped(StageRun& run) noexcept;
  void letGo(const StageRun& run) noexcept;
  void blendIn(double* data) noexcept;
  void takeFault(StageRun& run, FaultKind kind, const char* text) noexcept;
  bool isLate(StageRun& run) noexcept;
  void overrun(StageRun& run) noexcept;
  void commit(const StageRun& run) noexcept;
  void latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept;
  void setActivity(Activity activity) noexcept;
  StopPolicy policyOf(const WrittenSignal& written) const;

  ControllerInstance instance_;
  FeedbackController& controller_;  // of instance_
  std::uint32_t owner_;
  Stage stage_ = Stage::Task;
  double blend_s_;
  std::int64_t overrun_ns_;
  int overruns_to_pause_;
  bool lockstep_;
  StopPolicy on_fault_;

  Guard guard_;
  std::vector<Needed> needed_;
  std::array<Record, 3> records_;   // one for each buffer of the cycle
  unsigned last_ = 0;               // index of the newest record
  std::vector<double> state_;       // newest numbers of state()
  std::vector<double> from_;        // correction before the blend; while it runs, the step to it
  std::vector<double> now_, left_;  // buffers for one correction each
  double blend_ = 1.0;
  bool blend_begins_ = false;  // the next run of the controller is the first one of the blend
  GainValues gains_from_, gains_to_;
  double gain_weight_ = 1.0;

  Activity activity_ = Activity::Off;
  Why why_ = Why::Disabled;
  FaultKind fault_ = FaultKind::None;
  bool wanted_ = false;  // enabled, not paused, no fault
  bool enabled_ = false;
  bool paused_ = false;
  bool reset_pending_ = false;
  bool let_go_ = false;  // its correction has ended since the newest record
  bool gains_pending_ = true;
  int overruns_in_row_ = 0;
  std::uint32_t fault_clears_ = 0;
  std::uint32_t resets_ = 0;
  std::uint32_t reorders_ = 0;
  std::uint32_t gains_revision_ = 0;

  // shared
  std::atomic<Activity> shared_activity_{Activity::Off};
  std::atomic<FaultKind> shared_fault_{FaultKind::None};
  std::atomic<std::uint64_t> fault_cycle_{0};
  std::atomic<std::uint64_t> faults_{0};
  std::atomic<std::uint64_t> overruns_{0};
  std::atomic<std::int64_t> last_ns_{0};
  std::atomic<int> waiting_{-1};
  mutable coglab_rt::TripleBuffer<coglab_rt::FixedText<120>> fault_texts_;
  mutable std::mutex fault_text_mutex_;  // for readers; the cycle does not lock it
};

}  // namespace ctrl_more
