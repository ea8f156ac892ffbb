#include "manager/roster.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {

ControllerStatus Member::status() const {
  ControllerStatus status;
  slot->fillStatus(status);
  status.type = description.type;
  status.safety = description.safety;
  status.enabled = state.enabled;
  for (const auto& [reason, cause] : state.reasons) {
    status.reasons.push_back(reason);
    status.causes.push_back(cause);
  }
  if (status.fault != FaultKind::None) {
    status.reasons.push_back("fault: " + status.fault_text);
    status.causes.push_back(PauseCause::Fault);
  }
  status.paused = !status.reasons.empty();
  return status;
}

int Roster::indexOf(const std::string& name) const {
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i]->name == name) return static_cast<int>(i);
  }
  return -1;
}

const Member& Roster::member(const std::string& name) const {
  const int i = indexOf(name);
  if (i < 0) throw std::invalid_argument(unknownName(name));
  return *members[i];
}

std::vector<std::string> Roster::names() const {
  std::vector<std::string> list;
  for (const auto& member : members) list.push_back(member->name);
  return list;
}

std::string Roster::unknownName(const std::string& name) const {
  return "no controller '" + name + "' is loaded" + suggestion(name, names());
}

Draft Roster::draft() const {
  Draft draft;
  for (const auto& member : members) draft.states.push_back(member->state);
  draft.order = order;
  return draft;
}

Status Roster::checkShared(const Draft& draft) const {
  std::map<int, std::pair<std::string, bool>> taken;  // by offset: who, and whether alone
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (!draft.states[i].enabled) continue;
    const std::string& name = members[i]->name;
    for (const ResolvedControlUse& use : members[i]->slot->controlUses()) {
      if (!use.use.modifies) continue;
      auto& first = taken[use.signal.offset()];
      const bool alone = first.second || use.use.exclusive;
      if (!first.first.empty() && first.first != name && (refuse_shared || alone)) {
        return Status::failure(
            "'" + first.first + "' and '" + name + "' both modify " + use.name() + ", and " +
            (refuse_shared ? "sharedSignals is refuse" : "one of them declares it exclusive") +
            "; disable one of them first");
      }
      first = {name, alone};
    }
  }
  return {};
}

std::unique_ptr<Plan> Roster::planOf(const Draft& draft, std::uint64_t generation) const {
  auto plan = std::make_unique<Plan>();
  plan->generation = generation;
  for (const std::string& name : draft.order) {
    const int i = indexOf(name);
    const std::shared_ptr<ControllerSlot>& slot = members[i]->slot;
    const MemberState& state = draft.states[i];
    plan->entries.push_back({slot, state.enabled, !state.reasons.empty(), state.fault_clears,
                             state.resets, state.reorders, state.gains_revision, state.gains});
    plan->stages[static_cast<int>(slot->stage())].push_back(slot.get());
    plan->timed = plan->timed || slot->isTimed();
  }
  return plan;
}

void Roster::accept(Draft draft) noexcept {
  for (std::size_t i = 0; i < members.size(); ++i) {
    members[i]->state = std::move(draft.states[i]);
  }
  order = std::move(draft.order);
}

Status Roster::setProfile(const std::string& profile, const std::vector<std::string>& controllers) {
  if (profile.empty()) return Status::failure("a profile needs a name that is not empty");
  for (const std::string& name : controllers) {
    if (indexOf(name) < 0) {
      return Status::failure("profile '" + profile + "': " + unknownName(name), Cause::UnknownName);
    }
    if (std::count(controllers.begin(), controllers.end(), name) > 1) {
      return Status::failure("profile '" + profile + "': '" + name + "' appears twice");
    }
  }
  std::vector<std::string> list = controllers;
  profiles[profile] = std::move(list);
  return {};
}

}  // namespace ctrl_more
