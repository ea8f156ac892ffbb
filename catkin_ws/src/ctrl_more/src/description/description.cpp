#include "ctrl_more/description/description.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace ctrl_more {

const char* nameOf(StopPolicy policy) {
  static const char* const names[] = {"by kind", "hold", "fade", "zero"};
  return names[static_cast<int>(policy)];
}

RobotSignalUse& Description::measured(const std::string& role) {
  robot_signals.emplace_back().role = role;
  return robot_signals.back();
}

RobotSignalUse& Description::estimated(const std::string& role) {
  RobotSignalUse& use = measured(role);
  use.source = RobotSource::Estimated;
  return use;
}

ControlSignalUse& Description::reads(ControlContainer container, const std::string& role) {
  ControlSignalUse& use = control_signals.emplace_back();
  use.container = container;
  use.role = role;
  return use;
}

ControlSignalUse& Description::modifies(ControlContainer container, const std::string& role) {
  ControlSignalUse& use = reads(container, role);
  use.modifies = true;
  return use;
}

GainSpec& Description::gain(const std::string& name, double initial) {
  GainSpec& spec = gains.emplace_back();
  spec.name = name;
  spec.initial = {initial};
  return spec;
}

SettingSpec& Description::setting(const std::string& name, const std::string& initial) {
  SettingSpec& spec = settings.emplace_back();
  spec.name = name;
  spec.initial_text = initial;
  return spec;
}

SettingSpec& Description::setting(const std::string& name, const std::vector<double>& initial) {
  SettingSpec& spec = setting(name, "");
  spec.kind = SettingSpec::Kind::Numbers;
  spec.initial = initial;
  return spec;
}

StateSpec& Description::state(const std::string& name) {
  states.emplace_back().name = name;
  return states.back();
}

std::vector<std::string> Description::faults() const {
  std::vector<std::string> found;
  if (type.empty()) found.push_back("the description has no type");
  std::set<std::string> names;
  const auto unique = [&](const std::string& name, const std::string& what) {
    if (name.empty()) found.push_back("a " + what + " has no name");
    if (!names.insert(what + "/" + name).second) found.push_back(what + " '" + name + "' twice");
  };
  for (const GainSpec& spec : gains) {
    unique(spec.name, "configuration key");
    if (spec.size < 1 || static_cast<int>(spec.initial.size()) != spec.size) {
      found.push_back("gain '" + spec.name + "' must have as many initial values as its size");
    }
    for (const double v : spec.initial) {
      if (!(v >= spec.min && v <= spec.max)) {
        found.push_back("gain '" + spec.name + "' has an initial value outside its range");
      }
    }
  }
  const auto isTextSetting = [this](const std::string& name) {
    return std::any_of(settings.begin(), settings.end(), [&](const SettingSpec& spec) {
      return spec.name == name && spec.kind == SettingSpec::Kind::Text;
    });
  };
  for (const SettingSpec& spec : settings) unique(spec.name, "configuration key");
  for (const StateSpec& spec : states) unique(spec.name, "state");
  const auto checkSignal = [&](const auto& use, const char* group) {
    unique(std::string(group) + "/" + use.role, "signal");
    if (!use.key_setting.empty() && !isTextSetting(use.key_setting)) {
      found.push_back("signal '" + use.role + "' takes its key from '" + use.key_setting +
                      "', which is no text setting");
    }
  };
  for (const RobotSignalUse& use : robot_signals) {
    checkSignal(use, nameOf(use.source));
    if (!(use.max_age_s > 0.0)) found.push_back("signal '" + use.role + "' needs an age > 0");
  }
  for (const ControlSignalUse& use : control_signals) {
    checkSignal(use, nameOf(use.container));
    const bool joint_space = use.container == ControlContainer::JointSpaceReference;
    const bool any_stage = use.container == ControlContainer::OtherReference;
    if (use.modifies && !any_stage && joint_space != (stage == Stage::Joint)) {
      found.push_back("a controller of the " + std::string(nameOf(stage)) +
                      " stage cannot modify " + nameOf(use.container));
    }
  }
  return found;
}

std::vector<std::string> Description::emptyFields() const {
  std::vector<std::string> found;
  const auto need = [&](const std::string& value, const std::string& what) {
    if (value.empty()) found.push_back(type + ": " + what + " is empty");
  };
  need(type, "type");
  need(summary, "summary");
  need(use, "use");
  need(when, "when");
  need(limitations, "limitations");
  need(law, "law");
  need(source, "source");
  const auto needBoth = [&](const auto& spec, const std::string& what) {
    need(spec.unit, "unit of " + what);
    need(spec.text, "text of " + what);
  };
  const auto needSignals = [&](const auto& uses) {
    for (const auto& use : uses) {
      needBoth(use, "signal '" + use.role + "'");
      need(use.frame, "frame of signal '" + use.role + "'");
    }
  };
  needSignals(robot_signals);
  needSignals(control_signals);
  for (const GainSpec& s : gains) needBoth(s, "gain '" + s.name + "'");
  for (const SettingSpec& s : settings) {
    if (s.kind == SettingSpec::Kind::Numbers) need(s.unit, "unit of setting '" + s.name + "'");
    need(s.text, "text of setting '" + s.name + "'");
  }
  for (const StateSpec& s : states) needBoth(s, "state '" + s.name + "'");
  return found;
}

}  // namespace ctrl_more
