#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ctrl_more/gains.hpp"
#include "ctrl_more/signal.hpp"

namespace ctrl_more {

/// Several changes that the control cycle adopts together, between two cycles. Either all of them
/// are valid and happen, or none. They are applied in the order they were added.
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
    Profile,
    MotionSwitched,
  };

  /// One step.
  struct Step {
    Kind kind;                       ///< what to do
    std::string name;                ///< controller or profile; "": all controllers
    std::string reason;              ///< of Pause and Resume
    bool force = false;              ///< also for safety controllers
    std::vector<std::string> order;  ///< of Order
    GainValues gains;                ///< of Gains
  };

  /// Enables one controller.
  Change& enable(const std::string& name) { return add({Kind::Enable, name, "", false, {}, {}}); }

  /// Disables one controller; a safety controller only if forced.
  Change& disable(const std::string& name, bool force = false) {
    return add({Kind::Disable, name, "", force, {}, {}});
  }

  /// Adds a reason to pause one controller; a safety controller only if forced.
  Change& pause(const std::string& name, const std::string& reason = "user",
                bool force = false) {
    return add({Kind::Pause, name, reason, force, {}, {}});
  }

  /// Withdraws one reason to pause; the reason "fault" clears a latched fault.
  Change& resume(const std::string& name, const std::string& reason = "user") {
    return add({Kind::Resume, name, reason, false, {}, {}});
  }

  /// Sets the execution order: every loaded controller exactly once.
  Change& order(const std::vector<std::string>& names) {
    return add({Kind::Order, "", "", false, names, {}});
  }

  /// Replaces the gains of one controller, blended in.
  Change& gains(const std::string& name, const GainValues& values) {
    return add({Kind::Gains, name, "", false, {}, values});
  }

  /// Enables exactly the controllers of a profile and disables all others, safety controllers
  /// included. A name without a profile is refused.
  Change& profile(const std::string& name) {
    return add({Kind::Profile, name, "", false, {}, {}});
  }

  /// Tells that another motion controller writes the references from now on: controllers whose
  /// description says so are reset, and their corrections blended over.
  Change& motionSwitched() { return add({Kind::MotionSwitched, "", "", false, {}, {}}); }

  /// The steps in order.
  const std::vector<Step>& steps() const { return steps_; }

 private:
  Change& add(Step step) {
    steps_.push_back(std::move(step));
    return *this;
  }
  std::vector<Step> steps_;
};

}  // namespace ctrl_more
