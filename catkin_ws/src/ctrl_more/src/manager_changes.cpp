// Changes of a FeedbackControllersManager: each is tried on a draft, then published as a plan.
#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "controller_config.hpp"
#include "ctrl_more/config_node.hpp"
#include "manager_members.hpp"

namespace ctrl_more {
namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// The signals of a controller that a key, or a map and a key, means: each as map/key.
std::vector<std::string> meant(const ControllerSlot& slot, bool robot, const std::string& signal) {
  std::vector<std::string> found;
  const auto add = [&](const std::string& map, const std::string& key) {
    const std::string full = map + "/" + key;
    if (signal == key || signal == full) found.push_back(full);
  };
  if (robot) {
    for (const ResolvedRobotUse& use : slot.robotUses()) add(nameOf(use.use.source), use.key);
  } else {
    for (const ResolvedControlUse& use : slot.controlUses()) {
      add(nameOf(use.use.container), use.key);
    }
  }
  return found;
}

// What a controller has against gains; what it throws counts.
std::string complaintOf(const FeedbackController& controller, const GainValues& gains) {
  try {
    return controller.judgeGains(gains);
  } catch (const std::exception& e) {
    return std::string("judgeGains() threw: ") + e.what();
  } catch (...) {
    return "judgeGains() threw something that is not a std::exception";
  }
}

}  // namespace

Status FeedbackControllersManager::apply(const Change& change) {
  const Lock lock(mutex_);
  return applyLocked(change);
}

Status FeedbackControllersManager::prepare(const Change& change) {
  const Lock lock(mutex_);
  return applyLocked(change, true);
}

// Everything that can fail comes before the publication: what fails has changed nothing.
Status FeedbackControllersManager::applyLocked(const Change& change, bool prepared,
                                               std::string note) {
  Draft draft = draftOf();
  std::vector<std::string> spared;
  for (const Change::Step& step : change.steps()) {
    const Status status = applyStep(step, draft, spared);
    if (!status) return status;
  }
  Status status = checkExclusive(draft);
  if (!status) return status;
  if (!spared.empty()) {
    note = "left alone, because safety controllers must be forced: " + joined(spared);
  }
  std::set<std::string> resumed;
  for (const Change::Step& step : change.steps()) {
    if (step.kind != Change::Kind::Resume || step.name.empty()) continue;
    if (!resumed.insert(step.name).second) continue;
    const int i = indexOf(step.name);
    const MemberState& state = draft.states[i];
    std::vector<std::string> left(state.reasons.begin(), state.reasons.end());
    const ControllerStatus now = statusLocked(*members_[i]);
    if (now.fault != FaultKind::None && state.fault_clears == members_[i]->state.fault_clears) {
      left.push_back("fault: " + now.fault_text);
    }
    if (!left.empty()) note += step.name + " is still paused: " + joined(left);
  }
  auto before = std::make_unique<Draft>(draftOf());
  status = publish(std::move(draft), prepared);
  before_last_ = std::move(before);
  status.note(std::move(note));
  return status;
}

Status FeedbackControllersManager::applyStep(const Change::Step& step, Draft& draft,
                                             std::vector<std::string>& spared) const {
  using Kind = Change::Kind;
  if (step.kind == Kind::Order) {
    std::vector<std::string> wanted = step.order;
    std::vector<std::string> loaded = namesLocked();
    for (const std::string& name : wanted) {
      if (indexOf(name) < 0) return Status::failure("execution order: " + unknownName(name));
      if (std::count(wanted.begin(), wanted.end(), name) > 1) {
        return Status::failure("execution order: '" + name + "' appears twice");
      }
    }
    std::vector<std::string> missing;
    for (const std::string& name : loaded) {
      if (std::find(wanted.begin(), wanted.end(), name) == wanted.end()) missing.push_back(name);
    }
    if (!missing.empty()) {
      return Status::failure("execution order: every loaded controller must appear once, " +
                             ("missing: " + joined(missing)) + "; to leave one out, disable it");
    }
    for (std::size_t place = 0; place < wanted.size(); ++place) {
      if (draft.order[place] != wanted[place]) ++draft.states[indexOf(wanted[place])].reorders;
    }
    draft.order = wanted;
    return {};
  }
  if (step.kind == Kind::Profile) {
    const auto profile = profiles_.find(step.name);
    if (profile == profiles_.end()) {
      std::vector<std::string> known;
      for (const auto& entry : profiles_) known.push_back(entry.first);
      return Status::failure("there is no profile '" + step.name + "'" +
                             suggestion(step.name, known));
    }
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const auto& list = profile->second;
      draft.states[i].enabled =
          std::find(list.begin(), list.end(), members_[i]->name) != list.end();
    }
    return {};
  }
  if (step.kind == Kind::MotionSwitched) {
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (members_[i]->description.on_switch == SwitchPolicy::Reset) ++draft.states[i].resets;
    }
    return {};
  }
  if (!step.name.empty()) {
    const int i = indexOf(step.name);
    if (i < 0) return Status::failure(unknownName(step.name));
    return applyToMember(step, *members_[i], static_cast<std::size_t>(i), draft, spared);
  }
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const Status status = applyToMember(step, *members_[i], i, draft, spared);
    if (!status) return status;
  }
  return {};
}

Status FeedbackControllersManager::applyToMember(const Change::Step& step, const Member& member,
                                                 std::size_t index, Draft& draft,
                                                 std::vector<std::string>& spared) const {
  MemberState& state = draft.states[index];
  const bool stops = step.kind == Change::Kind::Pause || step.kind == Change::Kind::Disable;
  if (stops && member.description.safety && !step.force) {
    if (step.name.empty()) {
      spared.push_back(member.name);
      return {};
    }
    return Status::failure("'" + member.name + "' is a safety controller; pausing or disabling " +
                           "it must be forced");
  }
  switch (step.kind) {
    case Change::Kind::Enable: state.enabled = true; break;
    case Change::Kind::Disable: state.enabled = false; break;
    case Change::Kind::Pause:
      if (step.reason.empty() || step.reason == "fault") {
        return Status::failure("a reason to pause '" + member.name +
                               "' must not be empty or 'fault'");
      }
      state.reasons.insert(step.reason);
      break;
    case Change::Kind::Resume:
      if (step.reason == "fault") {
        ++state.fault_clears;
      } else {
        state.reasons.erase(step.reason);
      }
      break;
    case Change::Kind::Gains: {
      // Only numbers of the same controller class fit, and they were checked when they were set.
      GainValues checked(member.description.gains);
      for (const auto& gain : step.gains.all()) {
        const Status status = checked.set(gain.first, gain.second);
        if (!status) return Status::failure("'" + member.name + "': " + status.message());
      }
      const std::string complaint = complaintOf(member.slot->controller(), checked);
      if (!complaint.empty()) return Status::failure("'" + member.name + "': " + complaint);
      state.gains = std::make_shared<const GainValues>(checked);
      ++state.gains_revision;
      break;
    }
    default: break;
  }
  return {};
}

Status FeedbackControllersManager::checkExclusive(const Draft& draft) const {
  for (std::size_t a = 0; a < members_.size(); ++a) {
    if (!draft.states[a].enabled) continue;
    for (std::size_t b = a + 1; b < members_.size(); ++b) {
      if (!draft.states[b].enabled) continue;
      for (const ResolvedControlUse& x : members_[a]->slot->controlUses()) {
        for (const ResolvedControlUse& y : members_[b]->slot->controlUses()) {
          if (!x.use.modifies || !y.use.modifies) continue;
          if (x.signal.offset() != y.signal.offset()) continue;
          if (!refuse_shared_ && !x.use.exclusive && !y.use.exclusive) continue;
          return Status::failure(
              "'" + members_[a]->name + "' and '" + members_[b]->name + "' both modify " +
              nameOf(x.use.container) + "/" + x.key + ", and " +
              (refuse_shared_ ? "sharedSignals is refuse" : "one of them declares it exclusive") +
              "; disable one of them first");
        }
      }
    }
  }
  return {};
}

Status FeedbackControllersManager::bySignal(Change::Kind kind, bool robot,
                                            const std::string& signal, bool force) {
  const Lock lock(mutex_);
  Change change;
  std::vector<std::string> spared;
  const std::string what = robot ? "robot signal " : "control signal ";
  bool used = false;
  for (const auto& member : members_) {
    const std::vector<std::string> signals = meant(*member->slot, robot, signal);
    if (signals.empty()) continue;
    used = true;
    if (kind != Change::Kind::Resume && member->description.safety && !force) {
      spared.push_back(member->name);
    } else if (kind == Change::Kind::Disable) {
      change.disable(member->name, force);
    } else {
      for (const std::string& full : signals) {
        if (kind == Change::Kind::Pause) change.pause(member->name, what + full, force);
        if (kind == Change::Kind::Resume) change.resume(member->name, what + full);
      }
    }
  }
  if (!used) {
    return Status::failure("no loaded controller uses " + what + signal + "; see getUsed" +
                           (robot ? "Robot" : "Control") + "States()");
  }
  return applyLocked(change, false,
                     spared.empty() ? ""
                                    : "left alone, because safety controllers must be forced: " +
                                          joined(spared));
}

Status FeedbackControllersManager::enable() { return enable(""); }
Status FeedbackControllersManager::disable() { return disable(""); }
Status FeedbackControllersManager::pause() { return pause(""); }
Status FeedbackControllersManager::resume() { return resume(""); }

Status FeedbackControllersManager::enable(const std::string& name) {
  return apply(Change().enable(name));
}
Status FeedbackControllersManager::disable(const std::string& name, bool force) {
  return apply(Change().disable(name, force));
}
Status FeedbackControllersManager::pause(const std::string& name, bool force) {
  return apply(Change().pause(name, "user", force));
}
Status FeedbackControllersManager::resume(const std::string& name, const std::string& reason) {
  return apply(Change().resume(name, reason));
}
Status FeedbackControllersManager::pauseAllUsingRobotState(const std::string& signal, bool force) {
  return bySignal(Change::Kind::Pause, true, signal, force);
}
Status FeedbackControllersManager::pauseAllUsingControlState(const std::string& signal,
                                                             bool force) {
  return bySignal(Change::Kind::Pause, false, signal, force);
}
Status FeedbackControllersManager::resumeAllUsingRobotState(const std::string& signal) {
  return bySignal(Change::Kind::Resume, true, signal, false);
}
Status FeedbackControllersManager::resumeAllUsingControlState(const std::string& signal) {
  return bySignal(Change::Kind::Resume, false, signal, false);
}
Status FeedbackControllersManager::disableAllUsingRobotState(const std::string& signal,
                                                             bool force) {
  return bySignal(Change::Kind::Disable, true, signal, force);
}
Status FeedbackControllersManager::disableAllUsingControlState(const std::string& signal,
                                                               bool force) {
  return bySignal(Change::Kind::Disable, false, signal, force);
}

Status FeedbackControllersManager::setExecutionOrder(const std::vector<std::string>& names) {
  return apply(Change().order(names));
}

Status FeedbackControllersManager::applyProfile(const std::string& profile, bool motion_switched) {
  Change change;
  change.profile(profile);
  if (motion_switched) change.motionSwitched();
  return apply(change);
}

Status FeedbackControllersManager::loadGains(const std::string& name, const std::string& file) {
  const Lock lock(mutex_);
  const int i = indexOf(name);
  if (i < 0) return Status::failure(unknownName(name));
  try {
    const ControllerConfig config =
        readControllerConfig(members_[i]->description, ConfigNode::fromFile(file));
    const std::string changed = config.settings.firstDifference(members_[i]->settings);
    if (!changed.empty()) {
      return Status::failure(file + ": setting '" + changed + "' of '" + name +
                             "' cannot change while it is loaded; unload and load it");
    }
    return applyLocked(Change().gains(name, config.gains));
  } catch (const std::exception& e) {
    return Status::failure(e.what());
  }
}

Status FeedbackControllersManager::reloadGains(const std::string& name) {
  std::string file;
  {
    const Lock lock(mutex_);
    const int i = indexOf(name);
    if (i < 0) return Status::failure(unknownName(name));
    file = members_[i]->entry.config_file;
  }
  if (file.empty()) return Status::failure("'" + name + "' was loaded without a configFile");
  return loadGains(name, file);
}

Status FeedbackControllersManager::setGains(
    const std::string& name, const std::map<std::string, std::vector<double>>& gains) {
  const Lock lock(mutex_);
  const int i = indexOf(name);
  if (i < 0) return Status::failure(unknownName(name));
  GainValues values = *members_[i]->state.gains;
  for (const auto& entry : gains) {
    const Status status = values.set(entry.first, entry.second);
    if (!status) return Status::failure("'" + name + "': " + status.message());
  }
  return applyLocked(Change().gains(name, values));
}

Status FeedbackControllersManager::setEnabled(const std::string& name, bool enabled) {
  return enabled ? enable(name) : disable(name);
}
Status FeedbackControllersManager::setPaused(const std::string& name, bool paused) {
  return paused ? pause(name) : resume(name);
}
Status FeedbackControllersManager::replaceGains(const std::string& name,
                                                const GainValues& gains) {
  return apply(Change().gains(name, gains));
}

}  // namespace ctrl_more
