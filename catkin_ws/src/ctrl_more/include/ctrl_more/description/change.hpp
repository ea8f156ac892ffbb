#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace ctrl_more {

/// Several steps that the control cycle adopts together, between two cycles. If one step is
/// invalid, none is applied. Steps are applied in the order of their addition.
///
/// A step without a controller name ("") acts on all controllers. A step with a signal acts on all
/// controllers that use it. Both skip safety controllers unless forced; the note of the status then
/// lists them.
class Change {
 public:
  /// Action of a step.
  enum class Kind {
    Enable,
    Disable,
    Pause,
    Resume,
    Order,
    Gains,
    GainFile,
    Profile,
    MotionSwitched,
  };

  /// Which controllers a step of Enable, Disable, Pause or Resume acts on.
  enum class Who {
    Named,              ///< the one of this name; "": all
    UsingRobotState,    ///< all that use this robot signal: `key`, or `map/key`
    UsingControlState,  ///< all that use this control signal: `key`, or `container/key`
  };

  /// Values by gain.
  using Gains = std::map<std::string, std::vector<double>>;

  /// One step.
  struct Step {
    Kind kind;                            ///< action
    std::string name = {};                ///< controller, signal or profile
    Who who = Who::Named;                 ///< meaning of `name`
    std::string reason = {};              ///< for Pause and Resume by name
    bool force = false;                   ///< include safety controllers
    std::vector<std::string> order = {};  ///< for Order
    Gains gains = {};                     ///< for Gains
    std::string file = {};                ///< for GainFile
  };

  /// Adds a step.
  Change& add(Step step) {
    steps_.push_back(std::move(step));
    return *this;
  }

  /// Enables one controller, or all.
  Change& enable(const std::string& name) { return add({Kind::Enable, name}); }

  /// Disables one controller, or all. Safety controllers only if forced.
  Change& disable(const std::string& name, bool force = false) {
    return add({Kind::Disable, name, Who::Named, "", force});
  }

  /// Adds a pause reason to one controller, or to all. Safety controllers only if forced.
  Change& pause(const std::string& name, const std::string& reason = "user", bool force = false) {
    return add({Kind::Pause, name, Who::Named, reason, force});
  }

  /// Withdraws one pause reason. The reason "fault" clears a latched fault.
  Change& resume(const std::string& name, const std::string& reason = "user") {
    return add({Kind::Resume, name, Who::Named, reason});
  }

  /// Disables, pauses or resumes all controllers that use a signal. The pause reason is
  /// `robot signal map/key` or `control signal container/key`.
  Change& bySignal(Kind kind, Who who, const std::string& signal, bool force = false) {
    return add({kind, signal, who, "", force});
  }

  /// Sets the execution order: every loaded controller exactly once.
  Change& order(const std::vector<std::string>& names) {
    return add({Kind::Order, "", Who::Named, "", false, names});
  }

  /// Replaces gains of one controller. The other gains stay. New values are blended in.
  Change& gains(const std::string& name, const Gains& values) {
    return add({Kind::Gains, name, Who::Named, "", false, {}, values});
  }

  /// Replaces all gains of one controller by those of a file ("": its own file), blended in. Gains
  /// that are not in the file get their initial values. A setting that differs is refused.
  Change& gainFile(const std::string& name, const std::string& file) {
    return add({Kind::GainFile, name, Who::Named, "", false, {}, {}, file});
  }

  /// Enables exactly the controllers of a profile and disables all others, including safety
  /// controllers. An unknown profile is refused.
  Change& profile(const std::string& name) { return add({Kind::Profile, name}); }

  /// Another motion controller writes the references from now on. Controllers with
  /// SwitchPolicy::Reset are reset, and their corrections are blended.
  Change& motionSwitched() { return add({Kind::MotionSwitched}); }

  /// The steps, in order.
  const std::vector<Step>& steps() const { return steps_; }

 private:
  std::vector<Step> steps_;
};

}  // namespace ctrl_more
