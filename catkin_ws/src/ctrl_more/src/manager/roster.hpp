#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ctrl_more/cycle/controller_entry.hpp"
#include "ctrl_more/cycle/controller_status.hpp"
#include "cycle/controller_slot.hpp"
#include "cycle/plan.hpp"

namespace ctrl_more {

/// What can be changed of one controller, as services see it.
struct MemberState {
  bool enabled = false;
  std::map<std::string, PauseCause> reasons;  ///< to be paused, the latched fault not among them
  std::uint32_t fault_clears = 0;
  std::uint32_t resets = 0;
  std::uint32_t reorders = 0;
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// One loaded controller, as services see it.
struct Member {
  std::string name;
  ControllerEntry entry;
  Description description;
  SettingValues settings;
  std::shared_ptr<ControllerSlot> slot;
  MemberState state;

  /// Everything that is known of it.
  ControllerStatus status() const;
};

/// A copy of all that can be changed, to try changes on.
struct Draft {
  std::vector<MemberState> states;  ///< in load order
  std::vector<std::string> order;
};

/// The loaded controllers of a manager as the services see them. Whoever reads holds one of the two
/// mutexes; whoever writes holds both, `changes` first.
struct Roster {
  /// Controllers by profile.
  using Profiles = std::map<std::string, std::vector<std::string>>;

  /// One change at a time, for as long as it takes: controllers' own code runs under it.
  std::recursive_timed_mutex changes;
  /// For short, never while a controller's own code runs.
  mutable std::mutex mutex;
  std::vector<std::unique_ptr<Member>> members;  ///< load order
  std::vector<std::string> order;                ///< execution order
  Profiles profiles;
  bool refuse_shared = false;  ///< two enabled controllers may not modify one signal

  /// Place of a controller in `members`, -1 if it is not loaded.
  int indexOf(const std::string& name) const;
  /// A controller; throws std::invalid_argument with the nearest known name.
  const Member& member(const std::string& name) const;
  /// Names in load order.
  std::vector<std::string> names() const;
  /// The sentence about a name that is not loaded.
  std::string unknownName(const std::string& name) const;

  /// All that can be changed, as it is.
  Draft draft() const;
  /// Refuses a draft in which two enabled controllers modify a signal that cannot be shared.
  Status checkShared(const Draft& draft) const;
  /// The plan of a draft that has as many states as there are members.
  std::unique_ptr<Plan> planOf(const Draft& draft, std::uint64_t generation) const;
  /// Makes a draft the truth.
  void accept(Draft draft) noexcept;
  /// Sets or replaces a profile.
  Status setProfile(const std::string& profile, const std::vector<std::string>& controllers);
};

using RosterLock = std::lock_guard<std::mutex>;

/// Holds `changes`, unless another change does not end: then it is false.
class ChangeLock : public std::unique_lock<std::recursive_timed_mutex> {
 public:
  explicit ChangeLock(Roster& roster)
      : std::unique_lock<std::recursive_timed_mutex>(roster.changes, std::chrono::seconds(2)) {}
  /// The refusal if it is false.
  static Status busy() {
    return Status::failure(
        "another change has not ended within 2 s: the code of a controller does "
        "not return; if this goes on, start the program again",
        Cause::Busy);
  }
};

/// Tries a change on a draft, step by step.
/// @param roster the controllers
/// @param change what is asked for
/// @param draft what comes out; of no use after a failure
/// @return failure, or success with a note about what was left as it was
Status tryChange(const Roster& roster, const Change& change, Draft& draft);

}  // namespace ctrl_more
