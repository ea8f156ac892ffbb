#pragma once

#include <string>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/description/description.hpp"
#include "ctrl_more/description/gains.hpp"
#include "ctrl_more/description/settings.hpp"

namespace ctrl_more {

/// Gains and settings of one controller.
struct ControllerConfig {
  GainValues gains;
  SettingValues settings;

  /// Everything at its initial value.
  explicit ControllerConfig(const Description& description);
};

/// Reads a controller's configuration file against its description; throws ConfigError naming
/// file, line and field.
ControllerConfig readControllerConfig(const Description& description, const ConfigNode& file);

}  // namespace ctrl_more
