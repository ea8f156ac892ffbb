#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/description/description.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// Handle of one gain of one controller, from Setup::gain().
class Gain {
 public:
  /// An empty handle.
  Gain() = default;
  /// Number of doubles.
  int size() const { return static_cast<int>(size_); }

 private:
  friend class GainValues;
  std::uint32_t offset_ = 0;
  std::uint32_t size_ = 0;
};

/// All gains of one controller in one flat vector. The control cycle receives a change of gains as
/// one object and blends it in.
class GainValues {
 public:
  /// No gains.
  GainValues() = default;

  /// Every gain at its initial value.
  explicit GainValues(const std::vector<GainSpec>& specs);

  /// Handle of a gain. An unknown name throws std::invalid_argument with the known names.
  Gain find(const std::string& name) const;

  /// The elements of a gain.
  Eigen::Map<const Eigen::VectorXd> operator[](Gain gain) const {
    return Eigen::Map<const Eigen::VectorXd>(values_.data() + gain.offset_, gain.size_);
  }

  /// The first (or only) element of a gain.
  double scalar(Gain gain) const { return values_[gain.offset_]; }

  /// Sets one gain. Checks name, size, range and that the numbers are finite.
  /// @param name gain
  /// @param value one number per element, or one number for all elements
  Status set(const std::string& name, const std::vector<double>& value);

  /// Elements by gain name, for messages and users (the paper's getGains()).
  std::map<std::string, std::vector<double>> all() const;

  /// Declarations of the gains.
  const std::vector<GainSpec>& specs() const { return specs_; }

  /// Sets this to `from + weight (to - from)`, element by element; exactly `to` at weight 1.
  /// No allocation. All three belong to the same controller.
  void blend(const GainValues& from, const GainValues& to, double weight);

  /// Copies the numbers of another GainValues of the same controller. No allocation.
  void assign(const GainValues& other);

  /// True if all numbers are the same.
  bool sameAs(const GainValues& other) const { return values_ == other.values_; }

 private:
  std::vector<GainSpec> specs_;
  std::vector<std::uint32_t> offsets_;
  std::vector<double> values_;
};

/// Values of a controller's settings, checked against its description.
class SettingValues {
 public:
  /// Every setting at its initial value.
  explicit SettingValues(const std::vector<SettingSpec>& specs = {});

  /// Sets a text setting. Refuses unknown names and texts that are not among the choices.
  Status set(const std::string& name, const std::string& text);

  /// Sets a numeric setting. Refuses an unknown name, a wrong size, and a number that is out of
  /// range or not finite.
  Status set(const std::string& name, const std::vector<double>& numbers);

  /// A text setting. Throws std::invalid_argument if the description has none of this name.
  const std::string& text(const std::string& name) const;

  /// A numeric setting. Throws std::invalid_argument if the description has none of this name.
  const std::vector<double>& numbers(const std::string& name) const;

  /// Declarations of the settings.
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

/// Gains and settings of one controller.
struct ControllerConfig {
  GainValues gains;
  SettingValues settings;

  /// All gains and settings at their initial values.
  explicit ControllerConfig(const Description& description);
};

/// Reads a controller's configuration file and checks it against the description. Throws
/// ConfigError with file, line and field.
ControllerConfig readControllerConfig(const Description& description, const ConfigNode& file);

}  // namespace ctrl_more
