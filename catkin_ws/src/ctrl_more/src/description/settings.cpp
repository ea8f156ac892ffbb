#include "ctrl_more/description/settings.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {

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
  for (const double v : numbers) {
    if (!std::isfinite(v) || v < spec.min || v > spec.max) {
      std::ostringstream text;
      text << "'" << name << "' expects " << spec.min << " to " << spec.max << " " << spec.unit
           << ", got " << v;
      return Status::failure(text.str());
    }
  }
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

}  // namespace ctrl_more
