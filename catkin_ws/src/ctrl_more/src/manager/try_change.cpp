// Changes of a manager's controllers, tried on a draft.
#include <algorithm>
#include <set>
#include <stdexcept>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/log/words.hpp"
#include "description/controller_config.hpp"
#include "manager/roster.hpp"

namespace ctrl_more {
namespace {

using Kind = Change::Kind;
using Who = Change::Who;

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

// The signals of a controller that a key, or a map and a key, means: each as map/key.
std::vector<std::string> meant(const ControllerSlot& slot, Who who, const std::string& signal) {
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

/// One change on its way.
class Trial {
 public:
  Trial(const Roster& roster, Draft& draft) : roster_(roster), draft_(draft) {}

  Status step(const Change::Step& step) {
    switch (step.kind) {
      case Kind::Order:
        return order(step.order);
      case Kind::Profile:
        return profile(step.name);
      case Kind::MotionSwitched:
        return motionSwitched();
      case Kind::Gains:
      case Kind::GainFile:
        return gains(step);
      default:
        break;
    }
    if (step.who != Who::Named) return bySignal(step);
    if (!step.name.empty()) {
      const int i = roster_.indexOf(step.name);
      return i < 0 ? Status::failure(roster_.unknownName(step.name), Cause::UnknownName)
                   : byName(step, i, true);
    }
    for (std::size_t i = 0; i < draft_.states.size(); ++i) {
      const Status status = byName(step, i, false);
      if (!status) return status;
    }
    return {};
  }

  /// What was left as it was.
  std::string note(const Change& change) const {
    std::string text;
    if (!spared_.empty()) {
      text = "left alone, because safety controllers must be forced: " + joined(spared_);
    }
    std::set<std::string> resumed;
    for (const Change::Step& step : change.steps()) {
      if (step.kind != Kind::Resume || step.who != Who::Named || step.name.empty()) continue;
      if (!resumed.insert(step.name).second) continue;
      const std::vector<std::string> left = reasonsLeft(roster_.indexOf(step.name));
      if (!left.empty()) text += step.name + " is still paused: " + joined(left);
    }
    return text;
  }

 private:
  std::vector<std::string> reasonsLeft(int index) const {
    const Member& member = *roster_.members[index];
    const MemberState& state = draft_.states[index];
    std::vector<std::string> left;
    for (const auto& entry : state.reasons) left.push_back(entry.first);
    const ControllerStatus now = member.status();
    if (now.fault != FaultKind::None && state.fault_clears == member.state.fault_clears) {
      left.push_back("fault: " + now.fault_text);
    }
    return left;
  }

  bool mayStop(const Change::Step& step, const Member& member) const {
    const bool stops = step.kind == Kind::Pause || step.kind == Kind::Disable;
    return !stops || !member.description.safety || step.force;
  }

  Status byName(const Change::Step& step, std::size_t index, bool named) {
    const Member& member = *roster_.members[index];
    MemberState& state = draft_.states[index];
    if (!mayStop(step, member)) {
      if (named) {
        return Status::failure("'" + member.name + "' is a safety controller; pausing or " +
                               "disabling it must be forced");
      }
      spared_.push_back(member.name);
      return {};
    }
    if (step.kind == Kind::Pause && (step.reason.empty() || step.reason == "fault")) {
      return Status::failure("a reason to pause '" + member.name +
                             "' must not be empty or 'fault'");
    }
    if (step.kind == Kind::Resume && step.reason == "fault") {
      ++state.fault_clears;
    } else {
      set(state, step.kind, step.reason, PauseCause::User);
    }
    return {};
  }

  Status bySignal(const Change::Step& step) {
    const std::string what = step.who == Who::UsingRobotState ? "robot signal " : "control signal ";
    bool used = false;
    for (std::size_t i = 0; i < draft_.states.size(); ++i) {
      const Member& member = *roster_.members[i];
      const std::vector<std::string> signals = meant(*member.slot, step.who, step.name);
      if (signals.empty()) continue;
      used = true;
      if (!mayStop(step, member)) {
        spared_.push_back(member.name);
        continue;
      }
      for (const std::string& full : signals)
        set(draft_.states[i], step.kind, what + full, PauseCause::Signal);
    }
    if (used) return {};
    return Status::failure("no loaded controller uses " + what + step.name + "; see getUsed" +
                               (step.who == Who::UsingRobotState ? "Robot" : "Control") +
                               "States()",
                           Cause::UnknownName);
  }

  static void set(MemberState& state, Kind kind, const std::string& reason, PauseCause cause) {
    if (kind == Kind::Pause) state.reasons.emplace(reason, cause);
    if (kind == Kind::Resume) state.reasons.erase(reason);
    if (kind == Kind::Enable || kind == Kind::Disable) state.enabled = kind == Kind::Enable;
  }

  Status order(const std::vector<std::string>& wanted) {
    for (const std::string& name : wanted) {
      if (roster_.indexOf(name) < 0) {
        return Status::failure("execution order: " + roster_.unknownName(name), Cause::UnknownName);
      }
      if (std::count(wanted.begin(), wanted.end(), name) > 1) {
        return Status::failure("execution order: '" + name + "' appears twice");
      }
    }
    std::vector<std::string> missing;
    for (const std::string& name : roster_.names()) {
      if (std::count(wanted.begin(), wanted.end(), name) == 0) missing.push_back(name);
    }
    if (!missing.empty()) {
      return Status::failure("execution order: every loaded controller must appear once, " +
                             ("missing: " + joined(missing)) + "; to leave one out, disable it");
    }
    for (std::size_t place = 0; place < wanted.size(); ++place) {
      if (draft_.order[place] == wanted[place]) continue;
      ++draft_.states[roster_.indexOf(wanted[place])].reorders;
    }
    draft_.order = wanted;
    return {};
  }

  Status profile(const std::string& name) {
    const auto found = roster_.profiles.find(name);
    if (found == roster_.profiles.end()) {
      std::vector<std::string> known;
      for (const auto& entry : roster_.profiles) known.push_back(entry.first);
      return Status::failure("there is no profile '" + name + "'" + suggestion(name, known),
                             Cause::UnknownName);
    }
    const std::vector<std::string>& list = found->second;
    for (std::size_t i = 0; i < draft_.states.size(); ++i) {
      const std::string& member = roster_.members[i]->name;
      draft_.states[i].enabled = std::count(list.begin(), list.end(), member) != 0;
    }
    return {};
  }

  Status motionSwitched() {
    for (std::size_t i = 0; i < draft_.states.size(); ++i) {
      const bool resets = roster_.members[i]->description.on_switch == SwitchPolicy::Reset;
      if (resets) ++draft_.states[i].resets;
    }
    return {};
  }

  // Values are checked against the declaration of the controller, one by one and together.
  Status gains(const Change::Step& step) {
    const int i = roster_.indexOf(step.name);
    if (i < 0) return Status::failure(roster_.unknownName(step.name), Cause::UnknownName);
    const Member& member = *roster_.members[i];
    MemberState& state = draft_.states[i];
    GainValues values = *state.gains;
    if (step.kind == Kind::GainFile) {
      const Status status = readFile(step.file, member, values);
      if (!status) return status;
    }
    for (const auto& gain : step.gains) {
      const Status status = values.set(gain.first, gain.second);
      if (!status)
        return Status::failure("'" + member.name + "': " + status.message(), status.cause());
    }
    const std::string complaint = complaintOf(member.slot->controller(), values);
    if (!complaint.empty()) return Status::failure("'" + member.name + "': " + complaint);
    state.gains = std::make_shared<const GainValues>(values);
    ++state.gains_revision;
    return {};
  }

  static Status readFile(const std::string& given, const Member& member, GainValues& values) {
    const std::string& file = given.empty() ? member.entry.config_file : given;
    if (file.empty()) {
      return Status::failure("'" + member.name + "' was loaded without a configFile");
    }
    try {
      const ControllerConfig config =
          readControllerConfig(member.description, ConfigNode::fromFile(file));
      const std::string changed = config.settings.firstDifference(member.settings);
      if (!changed.empty()) {
        return Status::failure(file + ": setting '" + changed + "' of '" + member.name +
                               "' cannot change while it is loaded; unload and load it");
      }
      values = config.gains;
      return {};
    } catch (const std::exception& e) {
      return Status::failure(e.what(), Cause::BadFile);
    }
  }

  const Roster& roster_;
  Draft& draft_;
  std::vector<std::string> spared_;
};

}  // namespace

Status tryChange(const Roster& roster, const Change& change, Draft& draft) {
  Trial trial(roster, draft);
  for (const Change::Step& step : change.steps()) {
    const Status status = trial.step(step);
    if (!status) return status;
  }
  Status status = roster.checkShared(draft);
  if (status) status.note(trial.note(change));
  return status;
}

}  // namespace ctrl_more
