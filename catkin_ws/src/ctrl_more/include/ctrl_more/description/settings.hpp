#pragma once

#include <string>
#include <vector>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// Values of a controller's settings, checked against its description.
class SettingValues {
 public:
  /// Every setting at its initial value.
  explicit SettingValues(const std::vector<SettingSpec>& specs = {});

  /// Sets a text setting; refuses unknown names and texts that are not among the choices.
  Status set(const std::string& name, const std::string& text);

  /// Sets a numeric setting; refuses unknown names, other sizes, ranges, numbers not finite.
  Status set(const std::string& name, const std::vector<double>& numbers);

  /// A text setting; throws std::invalid_argument if the description has none of this name.
  const std::string& text(const std::string& name) const;

  /// A numeric setting; throws std::invalid_argument if the description has none of this name.
  const std::vector<double>& numbers(const std::string& name) const;

  /// What the settings are.
  const std::vector<SettingSpec>& specs() const { return specs_; }

  /// True if all values are the same.
  bool sameAs(const SettingValues& other) const {
    return texts_ == other.texts_ && numbers_ == other.numbers_;
  }

  /// Name of the first setting that differs; "" if none does.
  std::string firstDifference(const SettingValues& other) const;

 private:
  int indexOf(const std::string& name, SettingSpec::Kind kind) const;

  std::vector<SettingSpec> specs_;
  std::vector<std::string> texts_;
  std::vector<std::vector<double>> numbers_;
};

}  // namespace ctrl_more
