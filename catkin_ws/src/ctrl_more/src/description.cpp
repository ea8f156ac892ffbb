#include "ctrl_more/description.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace ctrl_more {

RobotSignalUse& RobotSignalUse::size(int n) { sizes.push_back(n); return *this; }
RobotSignalUse& RobotSignalUse::in(const std::string& units) { unit = units; return *this; }
RobotSignalUse& RobotSignalUse::frameOf(const std::string& name) { frame = name; return *this; }
RobotSignalUse& RobotSignalUse::about(const std::string& words) { text = words; return *this; }
RobotSignalUse& RobotSignalUse::keyFrom(const std::string& setting) {
  key_setting = setting;
  return *this;
}
RobotSignalUse& RobotSignalUse::maxAge(double seconds) { max_age_s = seconds; return *this; }

RobotSignalUse& RobotSignalUse::ifAsked() { if_asked = true; return *this; }

ControlSignalUse& ControlSignalUse::size(int n) { sizes.push_back(n); return *this; }
ControlSignalUse& ControlSignalUse::in(const std::string& units) { unit = units; return *this; }
ControlSignalUse& ControlSignalUse::frameOf(const std::string& name) {
  frame = name;
  return *this;
}
ControlSignalUse& ControlSignalUse::about(const std::string& words) { text = words; return *this; }
ControlSignalUse& ControlSignalUse::keyFrom(const std::string& setting) {
  key_setting = setting;
  return *this;
}
ControlSignalUse& ControlSignalUse::alone() { exclusive = true; return *this; }
ControlSignalUse& ControlSignalUse::bounded(const CorrectionLimit& limits) {
  limit = limits;
  return *this;
}
ControlSignalUse& ControlSignalUse::whenPaused(StopPolicy policy) {
  on_pause = policy;
  return *this;
}

ControlSignalUse& ControlSignalUse::ifAsked() { if_asked = true; return *this; }

GainSpec& GainSpec::vector(int n, double value) {
  size = n;
  initial.assign(n, value);
  return *this;
}
GainSpec& GainSpec::range(double smallest, double largest) {
  min = smallest;
  max = largest;
  return *this;
}
GainSpec& GainSpec::in(const std::string& units) { unit = units; return *this; }
GainSpec& GainSpec::about(const std::string& words) { text = words; return *this; }

SettingSpec& SettingSpec::oneOf(const std::vector<std::string>& texts) {
  choices = texts;
  return *this;
}
SettingSpec& SettingSpec::range(double smallest, double largest) {
  min = smallest;
  max = largest;
  return *this;
}
SettingSpec& SettingSpec::anySize() { any_size = true; return *this; }
SettingSpec& SettingSpec::in(const std::string& units) { unit = units; return *this; }
SettingSpec& SettingSpec::about(const std::string& words) { text = words; return *this; }

RobotSignalUse& Description::measured(const std::string& role) {
  RobotSignalUse use;
  use.role = role;
  robot_signals.push_back(use);
  return robot_signals.back();
}

RobotSignalUse& Description::estimated(const std::string& role) {
  RobotSignalUse& use = measured(role);
  use.source = RobotSource::Estimated;
  return use;
}

ControlSignalUse& Description::reads(ControlContainer container, const std::string& role) {
  ControlSignalUse use;
  use.container = container;
  use.role = role;
  control_signals.push_back(use);
  return control_signals.back();
}

ControlSignalUse& Description::modifies(ControlContainer container, const std::string& role) {
  ControlSignalUse& use = reads(container, role);
  use.modifies = true;
  return use;
}

GainSpec& Description::gain(const std::string& name, double initial) {
  GainSpec spec;
  spec.name = name;
  spec.initial = {initial};
  gains.push_back(spec);
  return gains.back();
}

SettingSpec& Description::setting(const std::string& name, const std::string& initial) {
  SettingSpec spec;
  spec.name = name;
  spec.initial_text = initial;
  settings.push_back(spec);
  return settings.back();
}

SettingSpec& Description::setting(const std::string& name, const std::vector<double>& initial) {
  SettingSpec spec;
  spec.name = name;
  spec.kind = SettingSpec::Kind::Numbers;
  spec.initial = initial;
  settings.push_back(spec);
  return settings.back();
}

StateSpec& StateSpec::in(const std::string& units) { return unit = units, *this; }
StateSpec& StateSpec::about(const std::string& words) { return text = words, *this; }

StateSpec& Description::state(const std::string& name) {
  states.push_back({name, "", ""});
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
  for (const RobotSignalUse& use : robot_signals) {
    unique(std::string(nameOf(use.source)) + "/" + use.role, "signal");
    if (!use.key_setting.empty() && !isTextSetting(use.key_setting)) {
      found.push_back("signal '" + use.role + "' takes its key from '" + use.key_setting +
                      "', which is no text setting");
    }
    if (!(use.max_age_s > 0.0)) found.push_back("signal '" + use.role + "' needs an age > 0");
  }
  for (const ControlSignalUse& use : control_signals) {
    unique(std::string(nameOf(use.container)) + "/" + use.role, "signal");
    if (!use.key_setting.empty() && !isTextSetting(use.key_setting)) {
      found.push_back("signal '" + use.role + "' takes its key from '" + use.key_setting +
                      "', which is no text setting");
    }
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
  for (const RobotSignalUse& s : robot_signals) {
    need(s.unit, "unit of signal '" + s.role + "'");
    need(s.frame, "frame of signal '" + s.role + "'");
    need(s.text, "text of signal '" + s.role + "'");
  }
  for (const ControlSignalUse& s : control_signals) {
    need(s.unit, "unit of signal '" + s.role + "'");
    need(s.frame, "frame of signal '" + s.role + "'");
    need(s.text, "text of signal '" + s.role + "'");
  }
  for (const GainSpec& s : gains) {
    need(s.unit, "unit of gain '" + s.name + "'");
    need(s.text, "text of gain '" + s.name + "'");
  }
  for (const SettingSpec& s : settings) {
    if (s.kind == SettingSpec::Kind::Numbers) need(s.unit, "unit of setting '" + s.name + "'");
    need(s.text, "text of setting '" + s.name + "'");
  }
  for (const StateSpec& s : states) {
    need(s.unit, "unit of state '" + s.name + "'");
    need(s.text, "text of state '" + s.name + "'");
  }
  return found;
}

}  // namespace ctrl_more
