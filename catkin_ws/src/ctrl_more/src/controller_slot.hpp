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
#include "shared_text.hpp"

namespace ctrl_more {

/// What the controllers of one stage share while they run one after another.
struct StageRun {
  const Cycle& cycle;
  const RobotStates& robot;
  const ControlStates& original;  ///< references before the stage
  ControlStates& control;
  double* data;          ///< of `control`
  const double** found;  ///< for the first double of each signal: where it is as the controller
                         ///< that runs found it
  double* compared;      ///< test mode: all of `data` as it found it; else null
  bool timed;
  unsigned buffer;       ///< the cycle's buffer of records, see RecordExchange
  double cycle_number;
  std::int64_t boundary_ns;  ///< steady clock between the last controller and this one
};

/// One loaded controller in the control cycle: runs it under guard, blends its corrections, and
/// tells the other threads what happened.
///
/// A controller runs on the references themselves. What it declared is judged, then either taken
/// back, or committed: recorded, before and after, for attribution and for the next fade. What one
/// left is what the next one found, so its record is also where the next one's changes are taken
/// back from (StageRun::found), and nothing is copied twice.
///
/// configure() and the const questions are for services; adopt() and run() are for the cycle and
/// neither allocate nor lock nor throw.
class __attribute__((visibility("hidden"), aligned(64))) ControllerSlot {
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
  /// One cycle of each of these controllers that has anything to do, in order.
  static void runAll(const std::vector<ControllerSlot*>& slots, StageRun& run) noexcept;
  /// @}

  /// @name Other threads
  /// @{
  Activity activity() const { return shared_activity_.load(std::memory_order_acquire); }
  FaultKind fault() const { return shared_fault_.load(std::memory_order_acquire); }
  void fillStatus(ControllerStatus& status) const;
  /// Adds what it changed, and its state, in the newest complete cycle.
  /// @param names for the names of signals
  /// @param buffer the reader's buffer of records, from RecordExchange::acquire()
  /// @param record of the cycle with its number; what is of another one is left out
  void addRecord(const ControlStates& names, unsigned buffer, CycleRecord& record) const;
  /// True if the duration of its update() is judged.
  bool isTimed() const { return overrun_ns_ > 0 && !lockstep_; }
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
  // The same, as far as every cycle needs it.
  struct Checked {
    std::uint32_t offset;
    std::uint16_t size;
    SignalKind kind;
  };
  struct alignas(64) Line {
    double numbers[8] = {};
  };
  struct Needed {
    RobotSignal signal{};
    std::int64_t max_age_ns;
  };

  enum class Why : std::uint8_t { Paused, Fault, Disabled, Stale };
  static constexpr std::uint8_t kLimited = 1;  // any signal has a finite limit
  static constexpr std::uint8_t kStates = 2;   // it declares states

  const Checked* checked() const {
    return checked_count_ == 1 ? &checked_ : all_checked_.data();
  }
  const Needed* needed() const { return needed_count_ == 1 ? &needed_ : all_needed_.data(); }
  const double* lastRecord() const { return records_ + last_ * record_size_; }
  bool idle() const { return activity_ == Activity::Off && !wanted_; }
  void start() noexcept;
  void stop(Why why) noexcept;
  void captureCorrection() noexcept;
  void advanceBlend(double dt) noexcept;
  void advanceGains(double dt) noexcept;
  template <bool kTimed, bool kTest>
  static void runEach(const std::vector<ControllerSlot*>& slots, StageRun& run) noexcept;
  static void fetchAhead(ControllerSlot* const* here, const ControllerSlot* const* end,
                         const StageRun& run) noexcept;
  bool isFresh(const StageRun& run) const noexcept;
  bool prepare(StageRun& run) noexcept;
  void noteWaiting(const StageRun& run) noexcept;
  void catchUp();
  void settle(StageRun& run) noexcept;
  static bool isGood(const Checked& c, const double* data) noexcept;
  static bool isGoodToo(const Checked& c, const double* value) noexcept;
  bool hasGoodNumbers(const double* data) const noexcept;
  FaultKind judgeMore(StageRun& run) noexcept;
  FaultKind judgeNumbers(const double* data) const noexcept;
  FaultKind judgeLimits(const StageRun& run) noexcept;
  bool restoreUndeclared(const StageRun& run) noexcept;
  bool isLate(StageRun& run) noexcept;
  void overrun(StageRun& run) noexcept;
  void takeFault(StageRun& run, FaultKind kind, const char* text) noexcept;
  void takeFailure(StageRun& run) noexcept;
  void blendIn(const StageRun& run) noexcept;
  void runStopped(StageRun& run) noexcept;
  bool passes(StageRun& run) noexcept;
  void recordState(const StageRun& run) noexcept;
  void commit(const StageRun& run) noexcept;
  static void commitSignal(const Checked& c, const StageRun& run, double* record,
                           std::size_t total) noexcept;
  void restore(const StageRun& run) const noexcept;
  void lastCorrection(double* correction) noexcept;
  void latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept;
  void setActivity(Activity activity) noexcept;
  StopPolicy policyOf(const Written& written) const;

  // The first cache line is all of the slot that a controller needs which runs undisturbed and
  // reads and modifies one signal; with more signals the lists are elsewhere.
  FeedbackController* controller_;  // of instance_, at hand
  std::uint32_t owner_;
  bool steady_ = false;   // it runs, and nothing is being blended, reset or replaced
  std::uint8_t special_ = 0;  // kLimited, kStates
  std::uint8_t checked_count_ = 0;
  std::uint8_t needed_count_ = 0;
  // Two records, one for each buffer: a number for the cycle, the doubles that it modifies as it
  // found them, and as it left them, and its state.
  double* records_ = nullptr;
  std::uint16_t total_ = 0;        // doubles that it modifies
  std::uint16_t record_size_ = 0;  // doubles from one record to the other
  std::uint32_t last_ = 0;         // buffer of the newer record
  Checked checked_{};
  Needed needed_{};

  Activity activity_ = Activity::Off;
  bool wanted_ = false;  // enabled, not paused, no fault
  bool reset_pending_ = false;
  bool gains_pending_ = true;
  bool raw_valid_ = false;
  bool enabled_ = false;
  bool paused_ = false;
  Stage stage_ = Stage::Task;
  FaultKind fault_ = FaultKind::None;
  Why why_ = Why::Disabled;
  double blend_ = 1.0;
  double gain_weight_ = 1.0;

  ControllerInstance instance_;
  double blend_s_;
  std::int64_t overrun_ns_;
  int overruns_to_pause_;
  bool lockstep_;
  StopPolicy on_fault_;
  std::vector<Written> written_;
  std::vector<Checked> all_checked_;
  std::vector<Needed> all_needed_;
  std::unique_ptr<Line[]> lines_;  // where the records are
  std::vector<bool> declared_;  // doubles of the control buffer it may change
  std::uint32_t fault_clears_ = 0;
  std::uint32_t resets_ = 0;
  std::uint32_t reorders_ = 0;
  std::uint32_t gains_revision_ = 0;
  int overruns_in_row_ = 0;
  std::vector<double> state_;  // what state() wrote last
  std::vector<double> from_;    // correction that the blend starts from
  std::vector<double> raw_;     // correction of the last run before blending
  std::vector<double> now_;     // room for one correction
  std::vector<double> step_;    // room for another
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
