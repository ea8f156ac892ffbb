#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "ctrl_more/description/gains.hpp"
#include "ctrl_more/states/cycle.hpp"

namespace ctrl_more {

class ControllerSlot;

/// What one controller is to do from the cycle that adopts the plan. Counters tell the slot what
/// is new, so that a plan which overtook another one loses nothing.
struct PlanEntry {
  std::shared_ptr<ControllerSlot> slot;  ///< keeps the instance and its library alive
  bool enabled = false;
  bool paused = false;
  std::uint32_t fault_clears = 0;  ///< faults up to here are forgiven
  std::uint32_t resets = 0;        ///< how often reset() was asked for
  std::uint32_t reorders = 0;      ///< how often its place in the order changed
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// Everything a manager is to do, immutable; see FeedbackControllersManager.
struct Plan {
  std::uint64_t generation = 0;
  bool timed = false;              ///< some controller's duration is judged
  std::vector<PlanEntry> entries;  ///< execution order
  std::array<std::vector<ControllerSlot*>, kStages> stages{};  ///< the same, per stage
};

}  // namespace ctrl_more
