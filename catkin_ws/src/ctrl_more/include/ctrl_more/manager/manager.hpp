#pragma once

#include <string>

#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// A part of the control cycle that the central module runs: feedback controllers, locomotion, or
/// whatever writes or modifies references (Ctrl-MORE paper, section VI).
///
/// In the cycle a manager sees the shared states only through the calls below, which neither
/// allocate nor lock nor throw.
class Manager {
 public:
  virtual ~Manager() = default;

  /// Name under which the central module's file lists it.
  virtual const std::string& name() const = 0;

  /// Start of a cycle: adopts what was requested since the last one.
  virtual void beginCycle(const Cycle& cycle) noexcept = 0;

  /// One stage of the cycle. A manager that has nothing to do in a stage does nothing.
  virtual void updateStage(Stage stage, const RobotStates& robot,
                           ControlStates& control) noexcept = 0;

  /// End of a cycle.
  virtual void endCycle() noexcept {}
};

}  // namespace ctrl_more
