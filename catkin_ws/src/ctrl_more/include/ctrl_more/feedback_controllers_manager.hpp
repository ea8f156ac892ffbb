/// @file
/// Manager of feedback controllers. It loads, orders and pauses them, and runs them in the two
/// stages of a control cycle (docs/architecture.md, steps 5 and 7).
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

/// Result of loading a list file.
struct LoadReport {
  std::vector<std::string> loaded;  ///< controllers that were loaded
  std::vector<std::string> errors;  ///< one sentence for each refusal
  /// True if nothing was refused.
  bool ok() const { return errors.empty(); }
  /// All errors as one text.
  std::string text() const;
};

/// Loads, orders, runs, pauses and guards feedback controllers (Ctrl-MORE paper, section V-B).
///
/// Threads: the *cycle* calls beginCycle(), updateStage() and endCycle(), with no allocation, lock,
/// system call or exception. *Services* (any other thread, serialised by a mutex) call all other
/// methods. A service validates each change on a copy, makes one immutable plan of it, and
/// publishes the plan through one atomic pointer. The cycle adopts the newest plan at its start and
/// acknowledges its generation. The service side frees what the cycle no longer uses. A refused
/// change has no effect.
///
/// The manager guards each controller in the cycle. A fault is an exception, a number that is not
/// finite, a quaternion that is not unit, or a correction beyond its declared size or rate. The
/// manager then undoes the controller's writes in the same cycle, releases its last correction by
/// its policy, and pauses it with the reason. The controllers after it run. A crash of the process
/// is not isolated.
///
/// Every start, stop or move of a controller is blended over `blend_s`, so that corrections are
/// continuous. With no enabled controller the references stay identical, bit by bit.
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
  /// `on_fault` (hold, fade, zero), `blend_s`. Further keys of the file: `profiles` (name:
  /// [controllers]), `searchPath` ([folders]), `sharedSignals` (cascade or refuse), `signals` (a
  /// file of robot signals that the controllers need; the host reads it, not this manager).
  /// All or nothing: if a controller is refused, nothing of the file is loaded, and the report has
  /// one sentence for each refusal. Controllers that were loaded before keep running.
  /// @param file path of the list file
  /// @param strict false: load what can be loaded, and report the rest
  LoadReport load(const std::string& file, bool strict = true);

  /// As load(), from a parsed file or text.
  /// @param list parsed list
  /// @param base folder for relative paths
  /// @param strict false: load what can be loaded, and report the rest
  LoadReport load(const ConfigNode& list, const std::string& base, bool strict = true);

  /// Loads one controller under a name.
  Status loadController(const std::string& name, const ControllerEntry& entry);

  /// Adds a controller that the program made itself.
  /// @param controller the instance
  /// @param name its name
  /// @param entry options; `library` and `type` are not used
  Status addController(std::unique_ptr<FeedbackController> controller, const std::string& name,
                       const ControllerEntry& entry = {});

  /// Unloads a controller. Refused unless it is disabled and its last correction has faded.
  Status unload(const std::string& name);

  /// Sets or replaces a profile. Applying it enables exactly these controllers, which must be
  /// loaded.
  Status setProfile(const std::string& profile, const std::vector<std::string>& controllers);
  /// @}

  /// @name Changing (services)
  /// Each method returns after it has published the plan. waitAdopted(status.generation()) waits
  /// for the cycle. An unknown name is refused; the message suggests the nearest known name.
  /// Without a name, or with the name "", a method acts on all controllers. It then skips safety
  /// controllers unless forced, and lists them in the note.
  /// @{

  /// Applies several steps between two cycles, all or nothing.
  Status apply(const Change& change) override;

  /// As apply(), but the cycle adopts the plan only in adoptPrepared(). Use it for a change that
  /// must begin in the same cycle as something else, such as a profile and its motion controller.
  /// The next ordinary change includes the prepared one.
  Status prepare(const Change& change);

  /// Waits until the cycle has adopted a plan.
  /// @param generation from Status::generation()
  /// @param timeout_s longest wait [s]
  /// @return false on time-out; the plan stays published and is adopted later
  bool waitAdopted(std::uint64_t generation, double timeout_s) const;

  /// Withdraws the newest plan if the cycle has not adopted it, and restores the state before it.
  /// It works for apply(), its short forms and prepare(), not for a load.
  /// @param generation from Status::generation()
  /// @return failure if the plan is already adopted or is not the newest one
  Status withdraw(std::uint64_t generation);

  /// Enables all.
  Status enable() { return enable(""); }
  /// Disables all.
  Status disable() { return disable(""); }
  /// Pauses all with the reason "user".
  Status pause() { return pause(""); }
  /// Withdraws the reason "user" of all.
  Status resume() { return resume(""); }
  /// Enables one.
  Status enable(const std::string& name) { return apply(Change().enable(name)); }
  /// Disables one.
  Status disable(const std::string& name, bool force = false) {
    return apply(Change().disable(name, force));
  }
  /// Pauses one with the reason "user".
  Status pause(const std::string& name, bool force = false) {
    return apply(Change().pause(name, "user", force));
  }
  /// Withdraws one reason of one controller. "fault" clears a latched fault. The note lists the
  /// reasons that remain.
  Status resume(const std::string& name, const std::string& reason = "user") {
    return apply(Change().resume(name, reason));
  }
  /// Pauses all users of `key` or `measuredData/key` (reason: `robot signal measuredData/key`).
  Status pauseAllUsingRobotState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Pause, Change::Who::UsingRobotState, signal, force);
  }
  /// Pauses all users of `key` or `container/key` (reason: `control signal container/key`).
  Status pauseAllUsingControlState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Pause, Change::Who::UsingControlState, signal, force);
  }
  /// Withdraws only the reason of this signal.
  Status resumeAllUsingRobotState(const std::string& signal) {
    return bySignal(Change::Kind::Resume, Change::Who::UsingRobotState, signal);
  }
  /// Withdraws only the reason of this signal.
  Status resumeAllUsingControlState(const std::string& signal) {
    return bySignal(Change::Kind::Resume, Change::Who::UsingControlState, signal);
  }
  /// Disables all users of a robot signal.
  Status disableAllUsingRobotState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Disable, Change::Who::UsingRobotState, signal, force);
  }
  /// Disables all users of a control signal.
  Status disableAllUsingControlState(const std::string& signal, bool force = false) {
    return bySignal(Change::Kind::Disable, Change::Who::UsingControlState, signal, force);
  }
  /// Sets the order: every loaded controller exactly once. On any error the old order stays.
  Status setExecutionOrder(const std::vector<std::string>& names) {
    return apply(Change().order(names));
  }
  /// Enables exactly the controllers of a profile, between two cycles; see Change::profile().
  Status applyProfile(const std::string& profile, bool motion_switched = true) {
    Change change;
    change.profile(profile);
    return apply(motion_switched ? change.motionSwitched() : change);
  }
  /// Reloads gains from a file. The whole file is checked first. A changed setting is refused. The
  /// new gains are blended in.
  Status loadGains(const std::string& name, const std::string& file) {
    if (file.empty()) return Status::failure("gains of '" + name + "': no file is given");
    return apply(Change().gainFile(name, file));
  }
  /// loadGains() from the controller's own file.
  Status reloadGains(const std::string& name) { return apply(Change().gainFile(name, "")); }
  /// Sets gains, all or nothing. They are blended in.
  Status setGains(const std::string& name,
                  const std::map<std::string, std::vector<double>>& gains) {
    return apply(Change().gains(name, gains));
  }
  /// @}

  /// @name Queries (services)
  /// An unknown name throws std::invalid_argument with the nearest known name.
  /// @{

  /// True if enabled, as last requested.
  bool isEnabled(const std::string& name) const override;
  /// True if paused for any reason, including a latched fault.
  bool isPaused(const std::string& name) const override;
  /// Gains as last requested.
  GainValues getGains(const std::string& name) const override;
  /// True if loaded.
  bool has(const std::string& name) const;
  /// Loaded controllers, in load order.
  std::vector<std::string> getControllersNames() const;
  /// Loaded controllers, in execution order.
  std::vector<std::string> getExecutionOrder() const;
  /// Names of the profiles.
  std::vector<std::string> getProfiles() const;
  /// True if the profile exists.
  bool hasProfile(const std::string& profile) const;
  /// Union of `map/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedRobotStates(bool enabled_only = false) const;
  /// Union of `container/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedControlStates(bool enabled_only = false) const;
  /// `container/key` of the references that one controller may correct.
  std::vector<std::string> getCorrected(const std::string& name) const;
  /// Declaration of one controller.
  Description describe(const std::string& name) const;
  /// Status of one controller.
  ControllerStatus status(const std::string& name) const;
  /// Status of all controllers, in execution order.
  std::vector<ControllerStatus> statusAll() const;
  /// Prints one controller.
  void plot(const std::string& name, std::ostream& out) const;
  /// Prints all, in execution order.
  void plotAll(std::ostream& out) const;

  /// Changes of references by each controller in the last complete cycle, in execution order,
  /// without controllers that are off.
  std::vector<Attribution> attribution() const { return lastCycle().changes; }
  /// attribution() plus the states of the controllers.
  CycleRecord lastCycle() const;
  /// Options of the constructor.
  const ManagerOptions& options() const { return options_; }
  /// @}

  /// @name Manager interface (the cycle)
  /// @{

  /// Name set by setName(); default `feedback`.
  const std::string& name() const override { return name_; }
  /// Sets the name in the central module's list. Only before the first cycle.
  void setName(const std::string& name) { name_ = name; }
  /// Fixes the layout of both stores and allocates the memory of the cycle. Call it outside the
  /// real-time thread, before its first cycle. Otherwise the first cycle does it.
  void freeze();
  /// Adopts the newest plan.
  void beginCycle(const Cycle& cycle) noexcept override;
  /// Adopts the plan of prepare(), if any. Call it between beginCycle() and the first stage.
  void adoptPrepared() noexcept;
  /// While `let_go` is true, no controller runs, and all corrections are zero at once, also held
  /// ones. Afterwards each enabled controller restarts: reset(), then its correction is blended in.
  /// For a host whose set-point does not move in this cycle, so that the end of a correction causes
  /// no motion. Call it between beginCycle() and the first stage.
  void letGo(bool let_go) noexcept;
  /// Snapshots the references as `original`, then runs the controllers of the stage in order.
  /// Both stores must be those of the constructor, or copies of them.
  void updateStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept override;
  /// Closes the cycle.
  void endCycle() noexcept override;

  /// A whole cycle: begin, all stages, end.
  void update(const Cycle& cycle, const RobotStates& robot, ControlStates& control) noexcept;

  /// A cycle as in the paper, for users without a clock. The time is the newest stamp in `robot`;
  /// dt is the control period of `control`.
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
  std::unique_ptr<CycleSide> cycle_;  // before the list: its controllers log the cycle number
  std::unique_ptr<ControllerList> list_;
  std::unique_ptr<PendingChange> before_last_;  // for withdraw(); under list_->changes
};

}  // namespace ctrl_more
