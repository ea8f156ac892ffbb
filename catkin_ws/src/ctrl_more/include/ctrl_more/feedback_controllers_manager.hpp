#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/change.hpp"
#include "ctrl_more/config_node.hpp"
#include "ctrl_more/control_states.hpp"
#include "ctrl_more/controller_status.hpp"
#include "ctrl_more/cycle.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/logger.hpp"
#include "ctrl_more/manager.hpp"
#include "ctrl_more/plugin_library.hpp"
#include "ctrl_more/robot_states.hpp"
#include "ctrl_more/status.hpp"

namespace ctrl_more {

class ControllerSlot;
class RecordExchange;
struct Plan;

/// How a manager runs its controllers.
struct ManagerOptions {
  double blend_s = 0.2;    ///< time over which any change is blended in [s]; 0: at once
  bool timed = false;      ///< measure each update() on the steady clock, as is done anyway while
                           ///< any controller has an `overrun_us` to be judged
  bool lockstep = false;   ///< simulated time: overruns are not judged
  int overruns_to_pause = 5;  ///< overruns in a row that pause a controller
  bool check_undeclared = false;  ///< test mode: compare everything a controller did not declare
};

/// How one controller is to be loaded; what the list file says of it.
struct ControllerEntry {
  std::string type;           ///< registered class; "": the only one in the library
  std::string library;        ///< `libPath` resolved; "": linked into the program
  std::string config_file;    ///< `configFile` resolved; "": defaults
  bool enabled = false;       ///< enabled from the start
  double overrun_us = 0.0;    ///< longest update() [us]; 0: not judged
  double blend_s = -1.0;      ///< own blend time [s]; < 0: the manager's
  StopPolicy on_fault = StopPolicy::Fade;  ///< the last correction after a fault
};

/// What a list file did.
struct LoadReport {
  std::vector<std::string> loaded;  ///< controllers that are there now
  std::vector<std::string> errors;  ///< one sentence each for those that are not
  /// True if nothing was refused.
  bool ok() const { return errors.empty(); }
  /// All errors as one text.
  std::string text() const;
};

/// Loads, orders, runs, pauses and guards feedback controllers (Ctrl-MORE paper, section V-B).
///
/// Two sides. The *cycle* calls beginCycle(), updateStage() and endCycle(): no allocation, no
/// lock, no system call, no exception. *Services* (any other thread, serialised here by a mutex)
/// call everything else: each change is validated against a copy, becomes one immutable plan, and
/// is published through one atomic pointer. The cycle adopts the newest plan at its start and
/// acknowledges its generation; what it no longer uses is freed by the service side. A refused
/// change leaves everything as it was.
///
/// In the cycle each controller is guarded: on an exception, a number that is not finite, a
/// quaternion that is not unit, or a correction beyond its declared size or rate, its writes are
/// undone in the same cycle, its last correction is let go by policy, it is paused with the
/// reason, and the controllers after it run. A crash of the process is not isolated.
///
/// Everything that starts, stops or moves a controller is blended over `blend_s`, so that
/// corrections are continuous. With no enabled controller the references keep their bits.
class FeedbackControllersManager : public Manager, private ControllerOwner {
 public:
  /// A manager without controllers.
  /// @param robot shared robot states; must outlive the manager
  /// @param control shared control states; must outlive the manager
  /// @param options see ManagerOptions
  /// @param logger null: Logger::standard()
  FeedbackControllersManager(RobotStates& robot, ControlStates& control,
                             const ManagerOptions& options = {}, Logger* logger = nullptr);
  ~FeedbackControllersManager() override;

  /// @name Loading (services)
  /// @{

  /// Loads a list file as printed in the paper: `loadControllers: [..]`, and for each name
  /// `libPath` and `configFile`. Further keys per controller: `type`, `enabled`, `overrun_us`,
  /// `on_fault` (hold, fade, zero), `blend_s`; of the file: `profiles` (name: [controllers]),
  /// `searchPath` ([folders]), `sharedSignals` (cascade or refuse).
  /// All or nothing: if anything is refused, nothing of the file is loaded, and the report says
  /// why, one sentence for each. What was loaded before keeps running.
  /// @param file path of the list file
  /// @param strict false: load what can be loaded, and report the rest
  LoadReport load(const std::string& file, bool strict = true);

  /// As load(), from a parsed file or text.
  /// @param list the tree
  /// @param base folder that relative paths refer to
  /// @param strict false: load what can be loaded, and report the rest
  LoadReport load(const ConfigNode& list, const std::string& base, bool strict = true);

  /// Loads one controller under a name.
  Status loadController(const std::string& name, const ControllerEntry& entry);

  /// Takes a controller that the program made itself.
  /// @param controller the instance
  /// @param name its name
  /// @param entry `library` and `type` are not used
  Status addController(std::unique_ptr<FeedbackController> controller, const std::string& name,
                       const ControllerEntry& entry = {});

  /// Unloads a controller; refused unless it is disabled and its last correction has faded.
  Status unload(const std::string& name);

  /// Sets or replaces a profile: exactly these controllers are enabled when it is applied.
  /// Names must be loaded.
  Status setProfile(const std::string& profile, const std::vector<std::string>& controllers);
  /// @}

  /// @name Changing (services)
  /// Each returns after publishing; waitAdopted(status.generation()) waits for the cycle. Unknown
  /// names are refused with the nearest known one. Forms without a name, and the name "", act on
  /// all controllers, leave safety controllers alone unless forced, and say so in the note.
  /// @{
  Status apply(const Change& change);       ///< several steps, all or nothing, one cycle boundary
  Status enable();                          ///< all
  Status disable();                         ///< all
  Status pause();                           ///< all, with the reason "user"
  Status resume();                          ///< all, the reason "user"
  Status enable(const std::string& name);   ///< one
  Status disable(const std::string& name, bool force = false);  ///< one
  Status pause(const std::string& name, bool force = false);    ///< one, with the reason "user"
  Status resume(const std::string& name, const std::string& reason = "user");
  ///< one, one reason; "fault" clears a latched fault. The note says what still pauses it
  Status pauseAllUsingRobotState(const std::string& signal, bool force = false);
  ///< key or `measuredData/key`; the reason is `robot signal measuredData/key` in both cases
  Status pauseAllUsingControlState(const std::string& signal, bool force = false);
  ///< key or `container/key`; the reason is `control signal container/key` in both cases
  Status resumeAllUsingRobotState(const std::string& signal);    ///< withdraws that reason only
  Status resumeAllUsingControlState(const std::string& signal);  ///< withdraws that reason only
  Status disableAllUsingRobotState(const std::string& signal, bool force = false);
  ///< disables them
  Status disableAllUsingControlState(const std::string& signal, bool force = false);
  ///< disables them
  Status setExecutionOrder(const std::vector<std::string>& names);
  ///< every loaded controller exactly once; on any error the old order stays
  Status applyProfile(const std::string& profile, bool motion_switched = true);
  ///< enables exactly these, at one cycle boundary; see Change::profile()
  Status loadGains(const std::string& name, const std::string& file);
  ///< hot reload: whole file checked first; changed settings are refused; gains are blended in
  Status reloadGains(const std::string& name);  ///< loadGains() from the controller's own file
  Status setGains(const std::string& name,
                  const std::map<std::string, std::vector<double>>& gains);
  ///< all or nothing, blended in

  /// As apply(), but the cycle takes the plan only where it calls adoptPrepared(): for a change
  /// that must begin in the same cycle as something else, as a profile with its motion controller.
  /// The next ordinary change includes what is prepared.
  Status prepare(const Change& change);

  /// Waits until the cycle has adopted a plan.
  /// @param generation from Status::generation()
  /// @param timeout_s longest wait [s]
  /// @return false on time-out; the plan stays published and will be adopted
  bool waitAdopted(std::uint64_t generation, double timeout_s) const;

  /// Takes back the newest plan if the cycle has not adopted it; everything is then as before it.
  /// Only the newest plan of apply(), its short forms and prepare() can be withdrawn, not a load.
  /// @param generation from Status::generation()
  /// @return failure if the plan is adopted already, or is not the newest one
  Status withdraw(std::uint64_t generation);
  /// @}

  /// @name Asking (services)
  /// Unknown names throw std::invalid_argument with the nearest known one.
  /// @{
  bool isEnabled(const std::string& name) const;  ///< as requested
  bool isPaused(const std::string& name) const;   ///< for any reason, a latched fault included
  bool has(const std::string& name) const;        ///< true if loaded
  std::vector<std::string> getControllersNames() const;  ///< loaded, in load order
  std::vector<std::string> getExecutionOrder() const;    ///< loaded, in execution order
  std::vector<std::string> getProfiles() const;          ///< names of the profiles
  bool hasProfile(const std::string& profile) const;     ///< true if it exists
  std::vector<std::string> getUsedRobotStates(bool enabled_only = false) const;
  ///< union of `map/key` over loaded (or enabled) controllers, sorted
  std::vector<std::string> getUsedControlStates(bool enabled_only = false) const;
  ///< union of `container/key` over loaded (or enabled) controllers, sorted
  Description describe(const std::string& name) const;  ///< declaration of one controller
  GainValues getGains(const std::string& name) const;   ///< gains as last requested
  ControllerStatus status(const std::string& name) const;  ///< one
  std::vector<ControllerStatus> statusAll() const;         ///< all, in execution order
  /// Who changed which reference by how much in the last complete cycle, in execution order;
  /// controllers that are off are left out. Waits for the end of the cycle that is running, 50 ms
  /// at most.
  std::vector<Attribution> attribution() const { return lastCycle().changes; }
  CycleRecord lastCycle() const;  ///< the same with the states of the controllers
  void plot(const std::string& name, std::ostream& out) const;  ///< one controller
  void plotAll(std::ostream& out) const;                        ///< all, in execution order
  const ManagerOptions& options() const { return options_; }    ///< as constructed
  /// @}

  /// @name Manager interface (the cycle)
  /// @{

  /// `feedback`, or what setName() said.
  const std::string& name() const override { return name_; }
  /// Name under which a central module lists it; before the first cycle.
  void setName(const std::string& name) { name_ = name; }
  /// Fixes the layout of both stores and allocates what the cycle needs. Call it before the first
  /// cycle of a real-time thread (outside of it); otherwise the first cycle does it, once.
  void freeze();
  /// Adopts the newest plan.
  void beginCycle(const Cycle& cycle) noexcept override;
  /// Adopts what prepare() left, if anything; between beginCycle() and the first stage.
  void adoptPrepared() noexcept;
  /// Snapshots the references as `original`, then runs the controllers of the stage in order.
  /// Both stores must be those of the constructor, or copies of them.
  void updateStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept override;
  /// Closes the cycle.
  void endCycle() noexcept override;

  /// A whole cycle: begin, all stages, end.
  void update(const Cycle& cycle, const RobotStates& robot, ControlStates& control) noexcept;

  /// The paper's form, for users without a clock: now is the newest stamp in `robot`, dt the
  /// control period of `control`.
  void update(const RobotStates& robot, ControlStates* control) noexcept;
  /// @}

 private:
  struct Member;
  struct Draft;
  class Undo;
  using Lock = std::lock_guard<std::recursive_mutex>;

  // ControllerOwner
  Status setEnabled(const std::string& name, bool enabled) override;
  Status setPaused(const std::string& name, bool paused) override;
  Status replaceGains(const std::string& name, const GainValues& gains) override;
  bool enabled(const std::string& name) const override { return isEnabled(name); }
  bool paused(const std::string& name) const override { return isPaused(name); }
  GainValues gainsOf(const std::string& name) const override { return getGains(name); }

  Status applyLocked(const Change& change, bool prepared = false, std::string note = "");
  Status applyStep(const Change::Step& step, Draft& draft, std::vector<std::string>& spared) const;
  Status applyToMember(const Change::Step& step, const Member& member, std::size_t index,
                       Draft& draft, std::vector<std::string>& spared) const;
  Status checkExclusive(const Draft& draft) const;
  Status bySignal(Change::Kind kind, bool robot, const std::string& signal, bool force);
  Draft draftOf() const;
  std::unique_ptr<Plan> planOf(const Draft& draft) const;
  Status publish(Draft draft, bool prepared = false);
  Status commit(Draft draft, bool prepared) noexcept;
  void forget(const Plan* untaken);
  void adopt(const Plan* plan) noexcept;
  void collect();
  Status take(ControllerInstance instance, const std::string& name, const ControllerEntry& entry,
              bool offer = true);
  void readList(const ConfigNode& list, const std::string& base, LoadReport& report);
  Status loadLocked(const std::string& name, const ControllerEntry& entry, bool offer = true);
  Status setProfileLocked(const std::string& profile, const std::vector<std::string>& controllers);
  Status unloadLocked(const std::string& name);
  int indexOf(const std::string& name) const;
  const Member& member(const std::string& name) const;
  std::vector<std::string> namesLocked() const;
  std::string unknownName(const std::string& name) const;
  ControllerStatus statusLocked(const Member& member) const;
  void runStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept;

  RobotStates& robot_;
  ControlStates& control_;
  ManagerOptions options_;
  Logger* logger_;
  LogSource log_;
  std::string name_ = "feedback";

  // service side, under mutex_
  mutable std::recursive_mutex mutex_;  // recursive: plotting asks back through ControllerOwner
  std::vector<std::unique_ptr<Member>> members_;  // load order
  std::vector<std::string> order_;
  std::map<std::string, std::vector<std::string>> profiles_;
  bool refuse_shared_ = false;
  std::uint32_t next_owner_ = 1;
  std::uint64_t generation_ = 0;
  std::deque<std::unique_ptr<const Plan>> plans_;  // what the cycle has or may still have
  std::unique_ptr<Draft> before_last_;             // what withdraw() returns to

  // shared
  std::atomic<const Plan*> offered_{nullptr};  // taken by the cycle with one exchange
  std::atomic<const Plan*> prepared_{nullptr};  // as offered_, but only by adoptPrepared()
  std::atomic<std::uint64_t> acknowledged_{0};
  std::atomic<std::uint64_t> cycle_number_{0};
  std::unique_ptr<RecordExchange> records_;
  std::uint64_t recorded_cycle_[2] = {0, 0};  // of each buffer; belongs to who has the buffer

  // cycle side
  unsigned buffer_ = 0;    // of records, in this cycle
  bool recorded_ = false;  // anything in this cycle
  bool laid_out_ = false;  // freeze() was here
  const Plan* plan_ = nullptr;
  Cycle cycle_;
  ControlStates original_;
  std::vector<int> signals_;          // first double of each signal in the control buffer
  std::vector<const double*> found_;  // for these: where it is as the next controller finds it
  std::vector<double> compared_;      // of the test mode
};

}  // namespace ctrl_more
