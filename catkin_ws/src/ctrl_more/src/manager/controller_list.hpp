#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ctrl_more/manager/controller_status.hpp"
#include "manager/plan.hpp"
#include "manager/slot.hpp"

namespace ctrl_more {

/// Requested state of one controller.
struct RequestedState {
  bool enabled = false;
  std::map<std::string, PauseCause> reasons;  ///< pause reasons, without the latched fault
  std::uint32_t fault_clears = 0;
  std::uint32_t resets = 0;
  std::uint32_t reorders = 0;
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// One loaded controller, as seen by services.
struct LoadedController {
  std::string name;
  ControllerEntry entry;
  Description description;
  SettingValues settings;
  std::shared_ptr<Slot> slot;
  RequestedState state;

  ControllerStatus status() const;
};

class PendingChange;

/// The loaded controllers of a manager, as seen by services. Readers lock one of the two mutexes.
/// Writers lock both, `changes` first.
class ControllerList {
 public:
  /// Controllers by profile.
  using Profiles = std::map<std::string, std::vector<std::string>>;

  /// Locked during a whole change. Code of controllers may run under this lock.
  std::recursive_timed_mutex changes;
  /// Locked only for a short time, never while code of a controller runs.
  mutable std::mutex mutex;
  std::vector<std::unique_ptr<LoadedController>> controllers;  ///< load order
  std::vector<std::string> order;                              ///< execution order
  Profiles profiles;
  bool refuse_shared = false;  ///< two enabled controllers may not modify one signal

  /// Index of a controller in `controllers`; -1 if it is not loaded.
  int indexOf(const std::string& name) const;
  /// A controller. An unknown name throws std::invalid_argument with the nearest known name.
  const LoadedController& at(const std::string& name) const;
  /// Names in load order.
  std::vector<std::string> names() const;
  /// Error message for a name that is not loaded.
  std::string unknownName(const std::string& name) const;
  /// Accepts a change as the current state.
  void accept(PendingChange change) noexcept;
  /// Sets or replaces a profile.
  Status setProfile(const std::string& profile, const std::vector<std::string>& names);
};

using ListLock = std::lock_guard<std::mutex>;

/// Locks `changes`. False if another change does not end within 2 s.
class ChangeLock : public std::unique_lock<std::recursive_timed_mutex> {
 public:
  explicit ChangeLock(ControllerList& list)
      : std::unique_lock<std::recursive_timed_mutex>(list.changes, std::chrono::seconds(2)) {}
  /// The refusal if the lock is false.
  static Status busy() {
    return Status::failure(
        "another change has not ended within 2 s: the code of a controller does "
        "not return; if this goes on, start the program again",
        Cause::Busy);
  }
};

/// A copy of the changeable state. A change is tried on it before the cycle receives it.
class PendingChange {
 public:
  /// Copies the current state.
  explicit PendingChange(const ControllerList& list);

  /// Applies all steps of a change.
  /// @return failure (the copy is then invalid), or success with a note about skipped controllers
  Status make(const Change& change);
  /// Refuses two enabled controllers that modify the same unshareable signal.
  Status checkShared() const;
  /// The plan for the cycle.
  std::unique_ptr<Plan> plan(std::uint64_t generation) const;

  std::vector<RequestedState> states;  ///< in load order
  std::vector<std::string> order;

 private:
  Status step(const Change::Step& step);
  Status byName(const Change::Step& step, std::size_t index, bool named);
  Status bySignal(const Change::Step& step);
  Status reorder(const std::vector<std::string>& wanted);
  Status profile(const std::string& name);
  Status gains(const Change::Step& step);
  std::vector<std::string> reasonsLeft(int index) const;
  std::string note(const Change& change) const;

  const ControllerList* list_;
  std::vector<std::string> spared_;  // safety controllers that were skipped
};

}  // namespace ctrl_more
