#include "ctrl_more/loading/prototypes.hpp"

namespace ctrl_more {

FeedbackControllerPrototypes::FeedbackControllerPrototypes()
    : PluginTypesOf("controller", "CTRL_MORE_REGISTER_CONTROLLER", "ctrl_more", thisAbi()) {}

bool FeedbackControllerPrototypes::insert(
    const std::pair<const std::string, FeedbackControllerMaker>& entry, const Abi& abi) {
  return add(entry.first, entry.second, abi);
}

FeedbackControllerPrototypes& prototypes() {
  static FeedbackControllerPrototypes the_map;
  return the_map;
}

}  // namespace ctrl_more
