#pragma once

#include <string>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/description/gains.hpp"
#include "ctrl_more/description/setup.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/handles.hpp"
#include "ctrl_more/states/modified_control_states.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// What the developer of a controller writes: a declaration, a start and a law; the other methods
/// only where they are needed.
///
/// Threads: update(), state(), reset() and gainsChanged() run in the control cycle: no allocation,
/// no lock, no system call. Everything else runs outside of it.
class ControlLaw {
 public:
  virtual ~ControlLaw() = default;

  /// The one declaration of the controller; see Description. Must not depend on the instance.
  virtual Description describe() const = 0;

  /// Fetches handles and configuration; called once, outside the cycle. May allocate and throw:
  /// an exception refuses the controller with its text.
  /// @param setup gives handles for what describe() declares
  virtual void initialize(Setup& setup) = 0;

  /// Runs the controller once. May throw or call FeedbackController::fail(): its writes are then
  /// undone, its last correction is let go by policy, and it is paused with the reason.
  /// @param cycle time
  /// @param robot robot states of this cycle
  /// @param original references at the start of the stage, before any feedback controller
  /// @param modified references as the controllers before this one left them
  virtual void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                      ModifiedControlStates& modified) = 0;

  /// Forgets internal state (integrators, filters, previous values). Called in the cycle before
  /// the first update() after enabling, after a fault, and at a switch of motion if the
  /// description says so.
  virtual void reset() {}

  /// Called in the cycle after gain values changed, before the next update().
  virtual void gainsChanged() {}

  /// Judges gains together (each alone is judged by its range), outside the cycle, before they are
  /// accepted.
  /// @return "" if they fit, else one sentence
  virtual std::string judgeGains(const GainValues& gains) const {
    static_cast<void>(gains);
    return "";
  }

  /// Writes the numbers that the description declares with Description::state(), in that order.
  /// Called in the cycle after each update(), if any is declared; the manager shows them.
  /// @param values as many as are declared
  virtual void state(Numbers<> values) const { static_cast<void>(values); }
};

}  // namespace ctrl_more
