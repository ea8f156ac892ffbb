#include "manager/controller_list.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/description/configuration.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

using Kind = Change::Kind;
using Who = Change::Who;

// The controller's objection to gains, or the exception of judgeGains(); empty if there is none.
std::string complaintOf(const FeedbackController& controller, const GainValues& gains) {
  try {
    return controller.judgeGains(gains);
  } catch (const std::exception& e) {
    return std::string("judgeGains() threw: ") + e.what();
  } catch (...) {
    return "judgeGains() threw something that is not a std::exception";
  }
}

// Signals of a controller that match `key` or `map/key`, as `map/key`.
std::vector<std::string> matching(const Slot& slot, Who who, const std::string& signal) {
  std::vector<std::string> found;
  const auto search = [&](const auto& uses) {
    for (const auto& use : uses) {
      if (signal == use.key || signal == use.name()) found.push_back(use.name());
    }
  };
  if (who == Who::UsingRobotState) {
    search(slot.robotUses());
  } else {
    search(slot.controlUses());
  }
  return found;
}

bool mayStop(const Change::Step& step, const LoadedController& controller) {
  const bool stops = step.kind == Kind::Pause || step.kind == Kind::Disable;
  return !stops || !controller.description.safety || step.force;
}

void request(RequestedState& state, Kind kind, const std::string& reason, PauseCause cause) {
  if (kind == Kind::Pause) state.reasons.emplace(reason, cause);
  if (kind == Kind::Resume) state.reasons.erase(reason);
  if (kind == Kind::Enable || kind == Kind::Disable) state.enabled = kind == Kind::Enable;
}

Status readFile(const std::string& given, const LoadedController& controller, GainValues& values) {
  const std::string& file = given.empty() ? controller.entry.config_file : given;
  if (file.empty()) {
    return Status::failure("'" + controller.name + "' was loaded without a configFile");
  }
  try {
    const ControllerConfig config =
        readControllerConfig(controller.description, ConfigNode::fromFile(file));
    const std::string changed = config.settings.firstDifference(controller.settings);
    if (!changed.empty()) {
      return Status::failure(file + ": setting '" + changed + "' of '" + controller.name +
                             "' cannot change while it is loaded; unload and load it");
    }
    values = config.gains;
    return {};
  } catch (const std::exception& e) {
    return Status::failure(e.what(), Cause::BadFile);
  }
}

}  // namespace

ControllerStatus LoadedController::status() const {
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

int ControllerList::indexOf(const std::string& name) const {
  for (std::size_t i = 0; i < controllers.size(); ++i) {
    if (controllers[i]->name == name) return static_cast<int>(i);
  }
  return -1;
}

const LoadedController& ControllerList::at(const std::string& name) const {
  const int i = indexOf(name);
  if (i < 0) throw std::invalid_argument(unknownName(name));
  return *controllers[i];
}

std::vector<std::string> ControllerList::names() const {
  std::vector<std::string> list;
  for (const auto& controller : controllers) list.push_back(controller->name);
  return list;
}

std::string ControllerList::unknownName(const std::string& name) const {
  return "no controller '" + name + "' is loaded" + suggestion(name, names());
}

void ControllerList::accept(PendingChange change) noexcept {
  for (std::size_t i = 0; i < controllers.size(); ++i) {
    controllers[i]->state = std::move(change.states[i]);
  }
  order = std::move(change.order);
}

Status ControllerList::setProfile(const std::string& profile,
                                  const std::vector<std::string>& names) {
  if (profile.empty()) return Status::failure("a profile needs a name that is not empty");
  for (const std::string& name : names) {
    if (indexOf(name) < 0) {
      return Status::failure("profile '" + profile + "': " + unknownName(name), Cause::UnknownName);
    }
    if (std::count(names.begin(), names.end(), name) > 1) {
      return Status::failure("profile '" + profile + "': '" + name + "' appears twice");
    }
  }
  std::vector<std::string> list = names;
  profiles[profile] = std::move(list);
  return {};
}

PendingChange::PendingChange(const ControllerList& list) : order(list.order), list_(&list) {
  for (const auto& controller : list.controllers) states.push_back(controller->state);
}

Status PendingChange::make(const Change& change) {
  for (const Change::Step& each : change.steps()) {
    const Status status = step(each);
    if (!status) return status;
  }
  Status status = checkShared();
  if (status) status.note(note(change));
  return status;
}

Status PendingChange::step(const Change::Step& step) {
  switch (step.kind) {
    case Kind::Order:
      return reorder(step.order);
    case Kind::Profile:
      return profile(step.name);
    case Kind::MotionSwitched:
      for (std::size_t i = 0; i < states.size(); ++i) {
        const bool resets = list_->controllers[i]->description.on_switch == SwitchPolicy::Reset;
        if (resets) ++states[i].resets;
      }
      return {};
    case Kind::Gains:
    case Kind::GainFile:
      return gains(step);
    default:
      break;
  }
  if (step.who != Who::Named) return bySignal(step);
  if (!step.name.empty()) {
    const int i = list_->indexOf(step.name);
    return i < 0 ? Status::failure(list_->unknownName(step.name), Cause::UnknownName)
                 : byName(step, i, true);
  }
  for (std::size_t i = 0; i < states.size(); ++i) {
    const Status status = byName(step, i, false);
    if (!status) return status;
  }
  return {};
}

// Lists the controllers that were skipped or are still paused.
std::string PendingChange::note(const Change& change) const {
  std::string text;
  if (!spared_.empty()) {
    text = "left alone, because safety controllers must be forced: " + joined(spared_);
  }
  std::set<std::string> resumed;
  for (const Change::Step& step : change.steps()) {
    if (step.kind != Kind::Resume || step.who != Who::Named || step.name.empty()) continue;
    if (!resumed.insert(step.name).second) continue;
    const std::vector<std::string> left = reasonsLeft(list_->indexOf(step.name));
    if (!left.empty()) text += step.name + " is still paused: " + joined(left);
  }
  return text;
}

std::vector<std::string> PendingChange::reasonsLeft(int index) const {
  const LoadedController& controller = *list_->controllers[index];
  const RequestedState& state = states[index];
  std::vector<std::string> left;
  for (const auto& entry : state.reasons) left.push_back(entry.first);
  const ControllerStatus now = controller.status();
  if (now.fault != FaultKind::None && state.fault_clears == controller.state.fault_clears) {
    left.push_back("fault: " + now.fault_text);
  }
  return left;
}

Status PendingChange::byName(const Change::Step& step, std::size_t index, bool named) {
  const LoadedController& controller = *list_->controllers[index];
  RequestedState& state = states[index];
  if (!mayStop(step, controller)) {
    if (named) {
      return Status::failure("'" + controller.name + "' is a safety controller; pausing or " +
                             "disabling it must be forced");
    }
    spared_.push_back(controller.name);
    return {};
  }
  if (step.kind == Kind::Pause && (step.reason.empty() || step.reason == "fault")) {
    return Status::failure("a reason to pause '" + controller.name +
                           "' must not be empty or 'fault'");
  }
  if (step.kind == Kind::Resume && step.reason == "fault") {
    ++state.fault_clears;
  } else {
    request(state, step.kind, step.reason, PauseCause::User);
  }
  return {};
}

Status PendingChange::bySignal(const Change::Step& step) {
  const std::string what = step.who == Who::UsingRobotState ? "robot signal " : "control signal ";
  bool used = false;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const LoadedController& controller = *list_->controllers[i];
    const std::vector<std::string> signals = matching(*controller.slot, step.who, step.name);
    if (signals.empty()) continue;
    used = true;
    if (!mayStop(step, controller)) {
      spared_.push_back(controller.name);
      continue;
    }
    for (const std::string& full : signals) {
      request(states[i], step.kind, what + full, PauseCause::Signal);
    }
  }
  if (used) return {};
  return Status::failure("no loaded controller uses " + what + step.name + "; see getUsed" +
                             (step.who == Who::UsingRobotState ? "Robot" : "Control") + "States()",
                         Cause::UnknownName);
}

Status PendingChange::reorder(const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted) {
    if (list_->indexOf(name) < 0) {
      return Status::failure("execution order: " + list_->unknownName(name), Cause::UnknownName);
    }
    if (std::count(wanted.begin(), wanted.end(), name) > 1) {
      return Status::failure("execution order: '" + name + "' appears twice");
    }
  }
  std::vector<std::string> missing;
  for (const std::string& name : list_->names()) {
    if (std::count(wanted.begin(), wanted.end(), name) == 0) missing.push_back(name);
  }
  if (!missing.empty()) {
    return Status::failure("execution order: every loaded controller must appear once, " +
                           ("missing: " + joined(missing)) + "; to leave one out, disable it");
  }
  for (std::size_t place = 0; place < wanted.size(); ++place) {
    if (order[place] == wanted[place]) continue;
    ++states[list_->indexOf(wanted[place])].reorders;
  }
  order = wanted;
  return {};
}

Status PendingChange::profile(const std::string& name) {
  const auto found = list_->profiles.find(name);
  if (found == list_->profiles.end()) {
    std::vector<std::string> known;
    for (const auto& entry : list_->profiles) known.push_back(entry.first);
    return Status::failure("there is no profile '" + name + "'" + suggestion(name, known),
                           Cause::UnknownName);
  }
  const std::vector<std::string>& list = found->second;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const std::string& controller = list_->controllers[i]->name;
    states[i].enabled = std::count(list.begin(), list.end(), controller) != 0;
  }
  return {};
}

// Checks each value against the declaration of the controller, then all gains together.
Status PendingChange::gains(const Change::Step& step) {
  const int i = list_->indexOf(step.name);
  if (i < 0) return Status::failure(list_->unknownName(step.name), Cause::UnknownName);
  const LoadedController& controller = *list_->controllers[i];
  RequestedState& state = states[i];
  GainValues values = *state.gains;
  if (step.kind == Kind::GainFile) {
    const Status status = readFile(step.file, controller, values);
    if (!status) return status;
  }
  for (const auto& gain : step.gains) {
    const Status status = values.set(gain.first, gain.second);
    if (!status)
      return Status::failure("'" + controller.name + "': " + status.message(), status.cause());
  }
  const std::string complaint = complaintOf(controller.slot->controller(), values);
  if (!complaint.empty()) return Status::failure("'" + controller.name + "': " + complaint);
  state.gains = std::make_shared<const GainValues>(values);
  ++state.gains_revision;
  return {};
}

Status PendingChange::checkShared() const {
  std::map<int, std::pair<std::string, bool>> taken;  // offset: controller, exclusive
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (!states[i].enabled) continue;
    const std::string& name = list_->controllers[i]->name;
    for (const ResolvedControlUse& use : list_->controllers[i]->slot->controlUses()) {
      if (!use.use.modifies) continue;
      auto& first = taken[use.signal.offset()];
      const bool alone = first.second || use.use.exclusive;
      if (!first.first.empty() && first.first != name && (list_->refuse_shared || alone)) {
        return Status::failure("'" + first.first + "' and '" + name + "' both modify " +
                               use.name() + ", and " +
                               (list_->refuse_shared ? "sharedSignals is refuse"
                                                     : "one of them declares it exclusive") +
                               "; disable one of them first");
      }
      first = {name, alone};
    }
  }
  return {};
}

std::unique_ptr<Plan> PendingChange::plan(std::uint64_t generation) const {
  auto plan = std::make_unique<Plan>();
  plan->generation = generation;
  for (const std::string& name : order) {
    const int i = list_->indexOf(name);
    const std::shared_ptr<Slot>& slot = list_->controllers[i]->slot;
    const RequestedState& state = states[i];
    plan->entries.push_back({slot, state.enabled, !state.reasons.empty(), state.fault_clears,
                             state.resets, state.reorders, state.gains_revision, state.gains});
    plan->stages[static_cast<int>(slot->stage())].push_back(slot.get());
    plan->timed = plan->timed || slot->isTimed();
  }
  return plan;
}

}  // namespace ctrl_more
