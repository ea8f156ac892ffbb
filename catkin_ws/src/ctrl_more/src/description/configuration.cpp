#include "ctrl_more/description/configuration.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

// "" if every number is finite and in its declared range, else one sentence.
template <typename Spec>
std::string outOfRange(const std::string& what, const Spec& spec,
                       const std::vector<double>& values) {
  for (const double v : values) {
    if (std::isfinite(v) && v >= spec.min && v <= spec.max) continue;
    std::ostringstream text;
    text << what << " expects " << spec.min << " to " << spec.max << " " << spec.unit << ", got "
         << v;
    const double most = std::max(std::abs(spec.min), std::abs(spec.max));
    if (spec.unit == "rad" && std::isfinite(v) && std::abs(v) > most) text << "; is it in degrees?";
    return text.str();
  }
  return "";
}

}  // namespace

GainValues::GainValues(const std::vector<GainSpec>& specs) : specs_(specs) {
  for (const GainSpec& spec : specs_) {
    offsets_.push_back(static_cast<std::uint32_t>(values_.size()));
    values_.insert(values_.end(), spec.initial.begin(), spec.initial.end());
  }
}

Gain GainValues::find(const std::string& name) const {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (specs_[i].name == name) {
      Gain gain;
      gain.offset_ = offsets_[i];
      gain.size_ = static_cast<std::uint32_t>(specs_[i].size);
      return gain;
    }
    known.push_back(specs_[i].name);
  }
  throw std::invalid_argument("no gain '" + name + "' is declared" + suggestion(name, known));
}

Status GainValues::set(const std::string& name, const std::vector<double>& value) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const GainSpec& spec = specs_[i];
    known.push_back(spec.name);
    if (spec.name != name) continue;
    if (value.size() != 1 && static_cast<int>(value.size()) != spec.size) {
      return Status::failure("gain '" + name + "' expects " + std::to_string(spec.size) +
                             " numbers (or one for all), got " + std::to_string(value.size()));
    }
    const std::string wrong = outOfRange("gain '" + name + "'", spec, value);
    if (!wrong.empty()) return Status::failure(wrong);
    for (int k = 0; k < spec.size; ++k) {
      values_[offsets_[i] + k] = value.size() == 1 ? value[0] : value[k];
    }
    return {};
  }
  return Status::failure("no gain '" + name + "'" + suggestion(name, known), Cause::UnknownName);
}

std::map<std::string, std::vector<double>> GainValues::all() const {
  std::map<std::string, std::vector<double>> result;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const auto first = values_.begin() + offsets_[i];
    result[specs_[i].name] = std::vector<double>(first, first + specs_[i].size);
  }
  return result;
}

void GainValues::blend(const GainValues& from, const GainValues& to, double weight) {
  const std::size_t n = values_.size();
  if (from.values_.size() != n || to.values_.size() != n) return;
  if (weight >= 1.0) {
    std::copy(to.values_.begin(), to.values_.end(), values_.begin());
    return;
  }
  for (std::size_t i = 0; i < n; ++i) {
    values_[i] = from.values_[i] + weight * (to.values_[i] - from.values_[i]);
  }
}

void GainValues::assign(const GainValues& other) {
  if (other.values_.size() != values_.size()) return;
  std::copy(other.values_.begin(), other.values_.end(), values_.begin());
}

SettingValues::SettingValues(const std::vector<SettingSpec>& specs) : specs_(specs) {
  for (const SettingSpec& spec : specs_) {
    texts_.push_back(spec.initial_text);
    numbers_.push_back(spec.initial);
  }
}

int SettingValues::indexOf(const std::string& name, SettingSpec::Kind kind) const {
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (specs_[i].name == name && specs_[i].kind == kind) return static_cast<int>(i);
  }
  return -1;
}

Status SettingValues::set(const std::string& name, const std::string& text) {
  const int i = indexOf(name, SettingSpec::Kind::Text);
  if (i < 0) return Status::failure("'" + name + "' is no text setting", Cause::UnknownName);
  const auto& choices = specs_[i].choices;
  if (!choices.empty() && std::find(choices.begin(), choices.end(), text) == choices.end()) {
    return Status::failure("'" + name + "' cannot be '" + text + "'" + suggestion(text, choices));
  }
  if (text.empty()) return Status::failure("'" + name + "' must not be empty");
  texts_[i] = text;
  return {};
}

Status SettingValues::set(const std::string& name, const std::vector<double>& numbers) {
  const int i = indexOf(name, SettingSpec::Kind::Numbers);
  if (i < 0) return Status::failure("'" + name + "' is no numeric setting", Cause::UnknownName);
  const SettingSpec& spec = specs_[i];
  if (numbers.empty() || (!spec.any_size && numbers.size() != spec.initial.size())) {
    return Status::failure("'" + name + "' expects " + std::to_string(spec.initial.size()) +
                           " numbers, got " + std::to_string(numbers.size()));
  }
  const std::string wrong = outOfRange("'" + name + "'", spec, numbers);
  if (!wrong.empty()) return Status::failure(wrong);
  numbers_[i] = numbers;
  return {};
}

const std::string& SettingValues::text(const std::string& name) const {
  const int i = indexOf(name, SettingSpec::Kind::Text);
  if (i < 0) throw std::invalid_argument("no text setting '" + name + "' is declared");
  return texts_[i];
}

const std::vector<double>& SettingValues::numbers(const std::string& name) const {
  const int i = indexOf(name, SettingSpec::Kind::Numbers);
  if (i < 0) throw std::invalid_argument("no numeric setting '" + name + "' is declared");
  return numbers_[i];
}

std::string SettingValues::firstDifference(const SettingValues& other) const {
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (texts_[i] != other.texts_[i] || numbers_[i] != other.numbers_[i]) return specs_[i].name;
  }
  return "";
}

ControllerConfig::ControllerConfig(const Description& description)
    : gains(description.gains), settings(description.settings) {}

ControllerConfig readControllerConfig(const Description& description, const ConfigNode& file) {
  ControllerConfig config(description);
  if (file.kind() == ConfigNode::Kind::Empty) return config;
  std::vector<std::string> known = {"type"};
  for (const GainSpec& spec : description.gains) known.push_back(spec.name);
  for (const SettingSpec& spec : description.settings) known.push_back(spec.name);
  file.requireKeys("configuration of " + description.type, known);
  const auto check = [](const ConfigNode& node, const Status& status) {
    if (!status) throw node.error(status.message());
  };
  if (const ConfigNode* type = file.find("type")) {
    if (type->text("type") != description.type) {
      throw type->error("this file is for type '" + type->text("type") +
                        "', but the controller is of type '" + description.type + "'");
    }
  }
  for (const GainSpec& spec : description.gains) {
    if (const ConfigNode* node = file.find(spec.name)) {
      check(*node, config.gains.set(spec.name, node->numbers("gain '" + spec.name + "'")));
    }
  }
  for (const SettingSpec& spec : description.settings) {
    const ConfigNode* node = file.find(spec.name);
    if (!node) continue;
    const std::string what = "setting '" + spec.name + "'";
    if (spec.kind == SettingSpec::Kind::Text) {
      check(*node, config.settings.set(spec.name, node->text(what)));
    } else {
      check(*node, config.settings.set(spec.name, node->numbers(what)));
    }
  }
  return config;
}

}  // namespace ctrl_more
