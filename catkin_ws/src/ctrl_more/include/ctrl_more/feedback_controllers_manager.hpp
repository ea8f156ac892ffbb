/// @file
/// The manager of feedback controllers: loads, orders, pauses and runs them in the two stages of a
/// control cycle (docs/architecture.md, steps 5 and 7).
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/description/change.hpp"
#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/controller_instance.hpp"
#include "ctrl_more/loading/search_path.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/manager/controller_status.hpp"
#include "ctrl_more/manager/manager.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "ctrl_more/states/signal_mailbox.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

class ControllerList;
class CycleSide;
class ListFile;
class PendingChange;

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
class FeedbackControllersManager : public Manager, public ControllerOwner {
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
  /// Each method returns after publishing; waitAdopted(status.generation()) waits for the cycle.
  /// Unknown names are refused with the nearest known one. Forms without a name, and the name "",
  /// act on all controllers, leave safety controllers alone unless forced, and say so in the note.
  /// @{

  /// Several steps, all or nothing, one cycle boundary.
  Status apply(const Change& change) override;

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

  /// All.
  Status enable() { return enable(""); }
  /// All.
  Status disable() { return disable(""); }
  /// All, with the reason "user".
  Status pause() { return pause(""); }
  /// All, the reason "user".
  Status resume() { return resume(""); }
  /// One.
  Status enable(const std::string& name) { return apply(Change().enable(name)); }
  /// One.
  Status disable(const std::string& name, bool force = false) {
    return apply(Change().disable(name, force));
  }
  /// One, with the reason "user".
  Status pause(const std::string& name, bool force = false) {
    return apply(Change().pause(name, "user", force));
  }
  /// One, one reason; "fault" clears a latched fault. The note says what still pauses it.
  Status resume(const std::string& name, const std::string& reason = "user") {
    return apply(Change().resume(name, reason));
  }
  /// By key or `measuredData/key`; the reason is `robot signal measuredData/key` in both cases.
  Status pauseAllUsingRobotState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Pause, Change::Who::UsingRobotState, signal, force);
  }
  /// By key or `container/key`; the reason is `control signal container/key` in both cases.
  Status pauseAllUsingControlState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Pause, Change::Who::UsingControlState, signal, force);
  }
  /// Withdraws that reason only.
  Status resumeAllUsingRobotState(const std::string& signal) {
    return bySignal(Change::Kind::Resume, Change::Who::UsingRobotState, signal);
  }
  /// Withdraws that reason only.
  Status resumeAllUsingControlState(const std::string& signal) {
    return bySignal(Change::Kind::Resume, Change::Who::UsingControlState, signal);
  }
  /// Disables them.
  Status disableAllUsingRobotState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Disable, Change::Who::UsingRobotState, signal, force);
  }
  /// Disables them.
  Status disableAllUsingControlState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Disable, Change::Who::UsingControlState, signal, force);
  }
  /// Every loaded controller exactly once; on any error the old order stays.
  Status setExecutionOrder(const std::vector<std::string>& names) {
    return apply(Change().order(names));
  }
  /// Enables exactly these, at one cycle boundary; see Change::profile().
  Status applyProfile(const std::string& profile, bool motion_switched = true) {
    Change change;
    change.profile(profile);
    return apply(motion_switched ? change.motionSwitched() : change);
  }
  /// Hot reload: whole file checked first; changed settings are refused; gains are blended in.
  Status loadGains(const std::string& name, const std::string& file) {
    if (file.empty()) return Status::failure("gains of '" + name + "': no file is given");
    return apply(Change().gainFile(name, file));
  }
  /// loadGains() from the controller's own file.
  Status reloadGains(const std::string& name) { return apply(Change().gainFile(name, "")); }
  /// All or nothing, blended in.
  Status setGains(const std::string& name,
                  const std::map<std::string, std::vector<double>>& gains) {
    return apply(Change().gains(name, gains));
  }
  /// @}

  /// @name Asking (services)
  /// Unknown names throw std::invalid_argument with the nearest known one.
  /// @{

  /// As requested.
  bool isEnabled(const std::string& name) const override;
  /// For any reason, a latched fault included.
  bool isPaused(const std::string& name) const override;
  /// Gains as last requested.
  GainValues getGains(const std::string& name) const override;
  /// True if loaded.
  bool has(const std::string& name) const;
  /// Loaded, in load order.
  std::vector<std::string> getControllersNames() const;
  /// Loaded, in execution order.
  std::vector<std::string> getExecutionOrder() const;
  /// Names of the profiles.
  std::vector<std::string> getProfiles() const;
  /// True if it exists.
  bool hasProfile(const std::string& profile) const;
  /// Union of `map/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedRobotStates(bool enabled_only = false) const;
  /// Union of `container/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedControlStates(bool enabled_only = false) const;
  /// Declaration of one controller.
  Description describe(const std::string& name) const;
  /// One controller.
  ControllerStatus status(const std::string& name) const;
  /// All, in execution order.
  std::vector<ControllerStatus> statusAll() const;
  /// Prints one controller.
  void plot(const std::string& name, std::ostream& out) const;
  /// Prints all, in execution order.
  void plotAll(std::ostream& out) const;

  /// Who changed which reference by how much in the last complete cycle, in execution order;
  /// controllers that are off are left out.
  std::vector<Attribution> attribution() const { return lastCycle().changes; }
  /// The same with the states of the controllers.
  CycleRecord lastCycle() const;
  /// As constructed.
  const ManagerOptions& options() const { return options_; }
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
  class Undo;

  Status bySignal(Change::Kind kind, Change::Who who, const std::string& signal,
                  bool force = false) {
    return apply(Change().bySignal(kind, who, signal, force));
  }
  Status change(const Change& change, bool prepared);
  Status publish(PendingChange change, bool prepared = false);
  Status commit(PendingChange change, bool prepared) noexcept;
  void readList(const ListFile& list, LoadReport& report);
  Status loadNamed(const std::string& name, const ControllerEntry& entry, bool offer);
  Status take(ControllerInstance instance, const std::string& name, const ControllerEntry& entry,
              bool offer);

  RobotStates& robot_;
  ControlStates& control_;
  ManagerOptions options_;
  Logger* logger_;
  std::string name_ = "feedback";
  std::uint32_t next_owner_ = 1;
  std::unique_ptr<CycleSide> cycle_;  // before the list, whose controllers log its number
  std::unique_ptr<ControllerList> list_;
  std::unique_ptr<PendingChange> before_last_;  // what withdraw() returns to; under list_->changes
};

}  // namespace ctrl_more
