#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace ctrl_more {

/// Several changes that the control cycle adopts together, between two cycles. Either all of them
/// are valid and happen, or none. They are applied in the order they were added.
///
/// Steps that name no controller (name "") act on all; those that name a signal act on all that
/// use it. Both leave safety controllers alone unless forced, and the status says so in its note.
class Change {
 public:
  /// What one step does.
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
    Kind kind;                            ///< what to do
    std::string name = {};                ///< controller, signal or profile
    Who who = Who::Named;                 ///< what `name` names
    std::string reason = {};              ///< of Pause and Resume by name
    bool force = false;                   ///< also for safety controllers
    std::vector<std::string> order = {};  ///< of Order
    Gains gains = {};                     ///< of Gains
    std::string file = {};                ///< of GainFile
  };

  /// Adds a step.
  Change& add(Step step) {
    steps_.push_back(std::move(step));
    return *this;
  }

  /// Enables one controller, or all.
  Change& enable(const std::string& name) { return add({Kind::Enable, name}); }

  /// Disables one controller, or all; safety controllers only if forced.
  Change& disable(const std::string& name, bool force = false) {
    return add({Kind::Disable, name, Who::Named, "", force});
  }

  /// Adds a reason to pause one controller, or all; safety controllers only if forced.
  Change& pause(const std::string& name, const std::string& reason = "user", bool force = false) {
    return add({Kind::Pause, name, Who::Named, reason, force});
  }

  /// Withdraws one reason to pause; the reason "fault" clears a latched fault.
  Change& resume(const std::string& name, const std::string& reason = "user") {
    return add({Kind::Resume, name, Who::Named, reason});
  }

  /// Disables, pauses or resumes all controllers that use a signal. The reason to pause is the
  /// signal: `robot signal map/key` or `control signal container/key`.
  Change& bySignal(Kind kind, Who who, const std::string& signal, bool force = false) {
    return add({kind, signal, who, "", force});
  }

  /// Sets the execution order: every loaded controller exactly once.
  Change& order(const std::vector<std::string>& names) {
    return add({Kind::Order, "", Who::Named, "", false, names});
  }

  /// Replaces gains of one controller, blended in; those that are not given stay.
  Change& gains(const std::string& name, const Gains& values) {
    return add({Kind::Gains, name, Who::Named, "", false, {}, values});
  }

  /// Replaces the gains of one controller by those of a file, blended in; "": its own file. Gains
  /// that the file does not give get their initial values; a setting that differs is refused.
  Change& gainFile(const std::string& name, const std::string& file) {
    return add({Kind::GainFile, name, Who::Named, "", false, {}, {}, file});
  }

  /// Enables exactly the controllers of a profile and disables all others, safety controllers
  /// included. A name without a profile is refused.
  Change& profile(const std::string& name) { return add({Kind::Profile, name}); }

  /// Tells that another motion controller writes the references from now on: controllers whose
  /// description says so are reset, and their corrections blended over.
  Change& motionSwitched() { return add({Kind::MotionSwitched}); }

  /// The steps in order.
  const std::vector<Step>& steps() const { return steps_; }

 private:
  std::vector<Step> steps_;
};

}  // namespace ctrl_more
