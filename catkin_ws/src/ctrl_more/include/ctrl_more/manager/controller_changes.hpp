#pragma once

#include <map>
#include <string>
#include <vector>

#include "ctrl_more/description/change.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// The changing methods of the Ctrl-MORE paper's manager (section V-B). Each is one list of
/// changes; apply() makes several together.
///
/// Each returns after publishing; FeedbackControllersManager::waitAdopted(status.generation())
/// waits for the cycle. Unknown names are refused with the nearest known one. Forms without a name,
/// and the name "", act on all controllers, leave safety controllers alone unless forced, and say
/// so in the note.
class ControllerChanges {
 public:
  virtual ~ControllerChanges() = default;

  /// Several steps, all or nothing, one cycle boundary.
  virtual Status apply(const Change& change) = 0;

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

 private:
  Status bySignal(Change::Kind kind, Change::Who who, const std::string& signal,
                  bool force = false) {
    return apply(Change().bySignal(kind, who, signal, force));
  }
};

}  // namespace ctrl_more
