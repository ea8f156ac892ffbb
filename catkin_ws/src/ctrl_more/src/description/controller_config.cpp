#include "description/controller_config.hpp"

namespace ctrl_more {

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
