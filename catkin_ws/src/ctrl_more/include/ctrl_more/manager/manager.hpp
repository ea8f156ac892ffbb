#pragma once

#include <string>

#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// A part of the control cycle that writes or modifies references, such as feedback controllers or
/// locomotion. The central module runs it (Ctrl-MORE paper, section VI).
///
/// In the cycle a manager accesses the shared states only in the calls below. They do not allocate,
/// lock or throw.
class Manager {
 public:
  virtual ~Manager() = default;

  /// Name in the central module's file.
  virtual const std::string& name() const = 0;

  /// Starts a cycle. Adopts the changes that were requested since the last one.
  virtual void beginCycle(const Cycle& cycle) noexcept = 0;

  /// Runs one stage of the cycle. May do nothing.
  virtual void updateStage(Stage stage, const RobotStates& robot,
                           ControlStates& control) noexcept = 0;

  /// Ends a cycle.
  virtual void endCycle() noexcept {}
};

}  // namespace ctrl_more
