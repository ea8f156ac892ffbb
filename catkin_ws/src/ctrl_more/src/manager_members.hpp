#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "controller_slot.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"

namespace ctrl_more {

/// What can be changed of one controller, as services see it.
struct MemberState {
  bool enabled = false;
  std::set<std::string> reasons;  // to be paused, the latched fault not among them
  std::uint32_t fault_clears = 0;
  std::uint32_t resets = 0;
  std::uint32_t reorders = 0;
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// One loaded controller, as services see it.
struct FeedbackControllersManager::Member {
  std::string name;
  ControllerEntry entry;
  Description description;
  SettingValues settings;
  std::shared_ptr<ControllerSlot> slot;
  MemberState state;
};

/// A copy of all that can be changed, to try changes on.
struct FeedbackControllersManager::Draft {
  std::vector<MemberState> states;  // in load order
  std::vector<std::string> order;
};

}  // namespace ctrl_more
