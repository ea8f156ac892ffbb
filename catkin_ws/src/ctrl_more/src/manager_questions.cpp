// Questions to a FeedbackControllersManager.
#include <algorithm>
#include <ostream>
#include <set>
#include <stdexcept>

#include "ctrl_more/config_node.hpp"
#include "ctrl_more/documentation.hpp"
#include "manager_members.hpp"
#include "record_exchange.hpp"

namespace ctrl_more {

int FeedbackControllersManager::indexOf(const std::string& name) const {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (members_[i]->name == name) return static_cast<int>(i);
  }
  return -1;
}

std::string FeedbackControllersManager::unknownName(const std::string& name) const {
  return "no controller '" + name + "' is loaded" + suggestion(name, namesLocked());
}

const FeedbackControllersManager::Member& FeedbackControllersManager::member(
    const std::string& name) const {
  const int i = indexOf(name);
  if (i < 0) throw std::invalid_argument(unknownName(name));
  return *members_[i];
}

std::vector<std::string> FeedbackControllersManager::namesLocked() const {
  std::vector<std::string> names;
  for (const auto& member : members_) names.push_back(member->name);
  return names;
}

bool FeedbackControllersManager::isEnabled(const std::string& name) const {
  const Lock lock(mutex_);
  return member(name).state.enabled;
}

bool FeedbackControllersManager::isPaused(const std::string& name) const {
  const Lock lock(mutex_);
  const Member& m = member(name);
  return !m.state.reasons.empty() || m.slot->fault() != FaultKind::None;
}

bool FeedbackControllersManager::has(const std::string& name) const {
  const Lock lock(mutex_);
  return indexOf(name) >= 0;
}

std::vector<std::string> FeedbackControllersManager::getControllersNames() const {
  const Lock lock(mutex_);
  return namesLocked();
}

std::vector<std::string> FeedbackControllersManager::getExecutionOrder() const {
  const Lock lock(mutex_);
  return order_;
}

std::vector<std::string> FeedbackControllersManager::getProfiles() const {
  const Lock lock(mutex_);
  std::vector<std::string> names;
  for (const auto& entry : profiles_) names.push_back(entry.first);
  return names;
}

bool FeedbackControllersManager::hasProfile(const std::string& profile) const {
  const Lock lock(mutex_);
  return profiles_.count(profile) != 0;
}

std::vector<std::string> FeedbackControllersManager::getUsedRobotStates(bool enabled_only) const {
  const Lock lock(mutex_);
  std::set<std::string> used;
  for (const auto& m : members_) {
    if (enabled_only && !m->state.enabled) continue;
    for (const ResolvedRobotUse& use : m->slot->robotUses()) {
      used.insert(std::string(nameOf(use.use.source)) + "/" + use.key);
    }
  }
  return {used.begin(), used.end()};
}

std::vector<std::string> FeedbackControllersManager::getUsedControlStates(
    bool enabled_only) const {
  const Lock lock(mutex_);
  std::set<std::string> used;
  for (const auto& m : members_) {
    if (enabled_only && !m->state.enabled) continue;
    for (const ResolvedControlUse& use : m->slot->controlUses()) {
      used.insert(std::string(nameOf(use.use.container)) + "/" + use.key);
    }
  }
  return {used.begin(), used.end()};
}

Description FeedbackControllersManager::describe(const std::string& name) const {
  const Lock lock(mutex_);
  return member(name).description;
}

GainValues FeedbackControllersManager::getGains(const std::string& name) const {
  const Lock lock(mutex_);
  return *member(name).state.gains;
}

ControllerStatus FeedbackControllersManager::statusLocked(const Member& m) const {
  ControllerStatus status;
  m.slot->fillStatus(status);
  status.type = m.description.type;
  status.safety = m.description.safety;
  status.enabled = m.state.enabled;
  status.reasons.assign(m.state.reasons.begin(), m.state.reasons.end());
  if (status.fault != FaultKind::None) status.reasons.push_back("fault: " + status.fault_text);
  status.paused = !status.reasons.empty();
  return status;
}

ControllerStatus FeedbackControllersManager::status(const std::string& name) const {
  const Lock lock(mutex_);
  return statusLocked(member(name));
}

std::vector<ControllerStatus> FeedbackControllersManager::statusAll() const {
  const Lock lock(mutex_);
  std::vector<ControllerStatus> list;
  for (const std::string& name : order_) list.push_back(statusLocked(member(name)));
  return list;
}

CycleRecord FeedbackControllersManager::lastCycle() const {
  const Lock lock(mutex_);
  const unsigned buffer = records_->acquire();
  CycleRecord record;
  record.cycle = recorded_cycle_[buffer];
  for (const std::string& name : order_) member(name).slot->addRecord(control_, buffer, record);
  return record;
}

void FeedbackControllersManager::plot(const std::string& name, std::ostream& out) const {
  const Lock lock(mutex_);
  out << plotText(member(name).slot->controller());
}

void FeedbackControllersManager::plotAll(std::ostream& out) const {
  const Lock lock(mutex_);
  for (const std::string& name : order_) plot(name, out);
}

}  // namespace ctrl_more
