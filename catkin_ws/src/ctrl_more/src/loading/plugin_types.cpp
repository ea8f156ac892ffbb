#include "ctrl_more/loading/plugin_types.hpp"

namespace ctrl_more {

std::vector<PluginTypes::Refusal> PluginTypes::takeRefused() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<Refusal> refused;
  refused.swap(refused_);
  return refused;
}

void PluginTypes::refuse(const std::string& type, const std::string& clause) {
  refused_.push_back({type, "registers '" + type + "'" + clause});
}

bool PluginTypes::admit(const std::string& type, bool known, bool has_maker, const Abi& abi) {
  if (!(abi == abi_)) {
    refuse(type, " " + abi.otherThan(package_, abi_));
  } else if (!has_maker) {
    refuse(type, " without a maker");
  } else if (known) {
    refuse(type, knownAlready());
  } else {
    return true;
  }
  return false;
}

}  // namespace ctrl_more
