#include "ctrl_more/docs/documentation.hpp"

#include <charconv>
#include <cmath>
#include <sstream>

namespace ctrl_more {
namespace {

std::string numberText(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

// The shortest text that converts back to the same number.
std::string exactText(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value);
  return std::string(text, end.ptr);
}

std::string listText(const std::vector<double>& values, std::string (*one)(double) = numberText) {
  if (values.size() == 1) return one(values[0]);
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + one(values[i]);
  return text + "]";
}

std::string sizesText(const std::vector<int>& sizes, int fixed) {
  if (sizes.empty()) return fixed != 0 ? std::to_string(fixed) : "any";
  std::string text;
  for (const int size : sizes) text += (text.empty() ? "" : " or ") + std::to_string(size);
  return text;
}

std::string rangeText(double min, double max) {
  if (!std::isfinite(min) && !std::isfinite(max)) return "any";
  if (!std::isfinite(max)) return ">= " + numberText(min);
  if (!std::isfinite(min)) return "<= " + numberText(max);
  return numberText(min) + " to " + numberText(max);
}

std::string ageText(double seconds) {
  return std::isfinite(seconds) ? numberText(1e3 * seconds) + " ms" : "any";
}

std::string limitText(const CorrectionLimit& limit) {
  std::string text;
  const auto add = [&](double value, const char* words) {
    if (std::isfinite(value)) text += (text.empty() ? "" : ", ") + numberText(value) + words;
  };
  add(limit.size, "");
  add(limit.rate, " per s");
  add(limit.angle, " rad");
  add(limit.angle_rate, " rad/s");
  return text.empty() ? "none" : text;
}

std::string keyText(const std::string& role, const std::string& setting, bool if_asked) {
  std::string text = "`" + role + "`";
  if (!setting.empty()) text += " (key: setting `" + setting + "`)";
  return if_asked ? text + ", depends on settings" : text;
}

void robotSection(std::ostream& out, const Description& d) {
  out << "## Robot signals\n\n";
  if (d.robot_signals.empty()) {
    out << "None.\n\n";
  } else {
    out << "| signal | map | size | unit | frame | largest age | meaning |\n"
        << "| --- | --- | --- | --- | --- | --- | --- |\n";
    for (const RobotSignalUse& s : d.robot_signals) {
      out << "| " << keyText(s.role, s.key_setting, s.if_asked) << " | " << nameOf(s.source)
          << " | " << sizesText(s.sizes, 0) << " | " << s.unit << " | " << s.frame << " | "
          << ageText(s.max_age_s) << " | " << s.text << " |\n";
    }
    out << '\n';
  }
}

void controlSection(std::ostream& out, const Description& d) {
  out << "## Control signals\n\n"
      << "| signal | container | size | unit | frame | access | bounds | paused | meaning |\n"
      << "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const ControlSignalUse& s : d.control_signals) {
    const char* by_kind = kindOf(s.container) == SignalKind::Vector ? "fade" : "hold";
    out << "| " << keyText(s.role, s.key_setting, s.if_asked) << " | " << nameOf(s.container)
        << " | "
        << (s.container == ControlContainer::JointSpaceReference && s.sizes.empty()
                ? "joints"
                : sizesText(s.sizes, fixedSizeOf(s.container)))
        << " | " << s.unit << " | " << s.frame << " | "
        << (s.modifies ? (s.exclusive ? "modified, alone" : "modified") : "read") << " | "
        << (s.modifies ? limitText(s.limit) : "-") << " | "
        << (!s.modifies                        ? "-"
            : s.on_pause == StopPolicy::ByKind ? by_kind
                                               : nameOf(s.on_pause))
        << " | " << s.text << " |\n";
  }
}

void gainSection(std::ostream& out, const Description& d) {
  out << "\n## Gains (changeable while it runs)\n\n";
  if (d.gains.empty()) {
    out << "None.\n";
  } else {
    out << "| gain | size | unit | range | initial | meaning |\n"
        << "| --- | --- | --- | --- | --- | --- |\n";
    for (const GainSpec& s : d.gains) {
      out << "| `" << s.name << "` | " << s.size << " | " << s.unit << " | "
          << rangeText(s.min, s.max) << " | " << listText(s.initial) << " | " << s.text << " |\n";
    }
  }
}

void settingSection(std::ostream& out, const Description& d) {
  out << "\n## Settings (fixed at load)\n\n";
  if (d.settings.empty()) {
    out << "None.\n";
  } else {
    out << "| setting | unit | allowed | initial | meaning |\n| --- | --- | --- | --- | --- |\n";
    for (const SettingSpec& s : d.settings) {
      const bool text = s.kind == SettingSpec::Kind::Text;
      std::string allowed = text ? "any name" : rangeText(s.min, s.max);
      if (text && !s.choices.empty()) {
        allowed.clear();
        for (const std::string& c : s.choices) allowed += (allowed.empty() ? "`" : ", `") + c + "`";
      }
      out << "| `" << s.name << "` | " << (text ? "-" : s.unit) << " | " << allowed << " | "
          << (text ? "`" + s.initial_text + "`" : listText(s.initial)) << " | " << s.text << " |\n";
    }
  }
}

void stateSection(std::ostream& out, const Description& d) {
  out << "\n## State (shown while it runs)\n\n";
  if (d.states.empty()) {
    out << "None.\n";
  } else {
    out << "| state | unit | meaning |\n| --- | --- | --- |\n";
    for (const StateSpec& s : d.states) {
      out << "| `" << s.name << "` | " << s.unit << " | " << s.text << " |\n";
    }
  }
}

}  // namespace

std::string plotText(const ControllerPlot& c) {
  const Description& d = c.description;
  const auto yesNo = [](bool yes) { return yes ? "yes" : "no"; };
  const auto sizeText = [](const auto& use, int fixed) {
    return use.signal.valid() ? std::to_string(use.signal.size()) : sizesText(use.use.sizes, fixed);
  };
  std::ostringstream out;
  out << c.name << " (" << d.type << ", " << nameOf(d.stage) << " stage)\n";
  out << "  " << d.summary << '\n';
  out << "  enabled: " << yesNo(c.enabled) << ", paused: " << yesNo(c.paused)
      << ", safety: " << yesNo(d.safety) << '\n';
  out << "  robot states:\n";
  for (const ResolvedRobotUse& use : c.robot) {
    out << "    " << use.name() << " [" << sizeText(use, 0) << "] (" << use.use.unit << ") in "
        << use.use.frame << ", age " << ageText(use.use.max_age_s) << '\n';
  }
  out << "  control states:\n";
  for (const ResolvedControlUse& use : c.control) {
    out << "    " << use.name() << " [" << sizeText(use, fixedSizeOf(use.use.container)) << "] ("
        << use.use.unit << ") in " << use.use.frame << ", "
        << (use.use.modifies ? "modified" : "read") << '\n';
  }
  out << "  gains:\n";
  for (const GainSpec& spec : d.gains) {
    const auto found = c.gains.find(spec.name);
    out << "    " << spec.name << " = "
        << listText(found == c.gains.end() ? spec.initial : found->second) << ' ' << spec.unit
        << " (" << rangeText(spec.min, spec.max) << ")\n";
  }
  if (!d.information.empty()) out << "  " << d.information << '\n';
  return out.str();
}

std::string documentationPage(const Description& d) {
  std::ostringstream out;
  out << "# " << d.type << "\n\n" << d.summary << "\n\n";
  out << "Generated from the controller's `describe()`; do not edit.\n\n";
  out << "| stage | safety | at a switch of motion |\n| --- | --- | --- |\n| " << nameOf(d.stage)
      << " | " << (d.safety ? "yes: refuses pause and disable unless forced" : "no") << " | "
      << (d.on_switch == SwitchPolicy::Reset ? "reset" : "state kept") << " |\n\n";
  out << "## Use\n\n"
      << d.use << "\n\n## When to apply it\n\n"
      << d.when << "\n\n## Limitations\n\n"
      << d.limitations << "\n\n## Law\n\n```math\n"
      << d.law << "\n```\n\nSource: " << d.source << "\n\n";
  robotSection(out, d);
  controlSection(out, d);
  gainSection(out, d);
  settingSection(out, d);
  stateSection(out, d);
  if (!d.information.empty()) out << "\n## More\n\n" << d.information << '\n';
  return out.str();
}

std::string configurationTemplate(const Description& d) {
  std::ostringstream out;
  out << "# Configuration of a controller of type " << d.type << ": " << d.summary << "\n";
  out << "type: " << d.type << "\n";
  if (!d.gains.empty()) out << "\n# Gains: read again by loadGains() while the controller runs.\n";
  for (const GainSpec& s : d.gains) {
    out << s.name << ": " << listText(s.initial, exactText) << "  # [" << s.unit << "] "
        << rangeText(s.min, s.max) << "; " << s.text << "\n";
  }
  if (!d.settings.empty()) out << "\n# Settings: fixed when the controller is loaded.\n";
  for (const SettingSpec& s : d.settings) {
    const bool text = s.kind == SettingSpec::Kind::Text;
    out << s.name << ": " << (text ? s.initial_text : listText(s.initial, exactText)) << "  # "
        << (text ? "" : "[" + s.unit + "] ") << s.text << "\n";
  }
  return out.str();
}

}  // namespace ctrl_more
