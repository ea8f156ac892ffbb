#include "ctrl_more/manager/controller_questions.hpp"

#include <set>

#include "manager/roster.hpp"

namespace ctrl_more {
namespace {

// The names of the signals in use, without doubles.
template <typename Uses>
std::vector<std::string> namesOf(const Roster& roster, bool enabled_only, Uses uses) {
  std::set<std::string> used;
  for (const auto& member : roster.members) {
    if (enabled_only && !member->state.enabled) continue;
    for (const auto& use : uses(*member->slot)) used.insert(use.name());
  }
  return {used.begin(), used.end()};
}

}  // namespace

ControllerQuestions::ControllerQuestions() : roster_(std::make_unique<Roster>()) {}
ControllerQuestions::~ControllerQuestions() = default;

bool ControllerQuestions::isEnabled(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  return roster_->member(name).state.enabled;
}

bool ControllerQuestions::isPaused(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  const Member& member = roster_->member(name);
  return !member.state.reasons.empty() || member.slot->fault() != FaultKind::None;
}

GainValues ControllerQuestions::getGains(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  return *roster_->member(name).state.gains;
}

bool ControllerQuestions::has(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  return roster_->indexOf(name) >= 0;
}

std::vector<std::string> ControllerQuestions::getControllersNames() const {
  const RosterLock lock(roster_->mutex);
  return roster_->names();
}

std::vector<std::string> ControllerQuestions::getExecutionOrder() const {
  const RosterLock lock(roster_->mutex);
  return roster_->order;
}

std::vector<std::string> ControllerQuestions::getProfiles() const {
  const RosterLock lock(roster_->mutex);
  std::vector<std::string> names;
  for (const auto& entry : roster_->profiles) names.push_back(entry.first);
  return names;
}

bool ControllerQuestions::hasProfile(const std::string& profile) const {
  const RosterLock lock(roster_->mutex);
  return roster_->profiles.count(profile) != 0;
}

std::vector<std::string> ControllerQuestions::getUsedRobotStates(bool enabled_only) const {
  const RosterLock lock(roster_->mutex);
  return namesOf(*roster_, enabled_only,
                 [](const ControllerSlot& slot) { return slot.robotUses(); });
}

std::vector<std::string> ControllerQuestions::getUsedControlStates(bool enabled_only) const {
  const RosterLock lock(roster_->mutex);
  return namesOf(*roster_, enabled_only,
                 [](const ControllerSlot& slot) { return slot.controlUses(); });
}

Description ControllerQuestions::describe(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  return roster_->member(name).description;
}

ControllerStatus ControllerQuestions::status(const std::string& name) const {
  const RosterLock lock(roster_->mutex);
  return roster_->member(name).status();
}

std::vector<ControllerStatus> ControllerQuestions::statusAll() const {
  const RosterLock lock(roster_->mutex);
  std::vector<ControllerStatus> list;
  for (const std::string& name : roster_->order) list.push_back(roster_->member(name).status());
  return list;
}

void ControllerQuestions::plot(const std::string& name, std::ostream& out) const {
  std::shared_ptr<const ControllerSlot> slot;
  {
    const RosterLock lock(roster_->mutex);
    slot = roster_->member(name).slot;
  }
  slot->controller().plot(out);  // its own code, which asks back through ControllerOwner
}

void ControllerQuestions::plotAll(std::ostream& out) const {
  for (const std::string& name : getExecutionOrder()) plot(name, out);
}

}  // namespace ctrl_more
