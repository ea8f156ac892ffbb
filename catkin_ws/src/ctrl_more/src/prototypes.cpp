#include "ctrl_more/prototypes.hpp"

namespace ctrl_more {

bool FeedbackControllerPrototypes::insert(
    const std::pair<const std::string, FeedbackControllerMaker>& entry, const Abi& abi) {
  const std::string what = "registers '" + entry.first + "'";
  if (!(abi == thisAbi())) {
    refused_.push_back(what + " compiled for another ctrl_more (" + abi.text() +
                       "; this program has " + thisAbi().text() +
                       "): build it again with the headers and the compiler of this program");
    return false;
  }
  if (entry.second == nullptr) {
    refused_.push_back(what + " without a maker");
    return false;
  }
  if (makers_.insert(entry).second) return true;
  refused_.push_back(what + ", which is registered already; give its controller another name");
  return false;
}

void FeedbackControllerPrototypes::erase(const std::string& type, FeedbackControllerMaker maker) {
  const auto found = makers_.find(type);
  if (found != makers_.end() && found->second == maker) makers_.erase(found);
}

FeedbackControllerMaker FeedbackControllerPrototypes::find(const std::string& type) const {
  const auto found = makers_.find(type);
  return found == makers_.end() ? nullptr : found->second;
}

std::vector<std::string> FeedbackControllerPrototypes::types() const {
  std::vector<std::string> names;
  for (const auto& entry : makers_) names.push_back(entry.first);
  return names;
}

std::vector<std::string> FeedbackControllerPrototypes::takeRefused() {
  std::vector<std::string> refused;
  refused.swap(refused_);
  return refused;
}

FeedbackControllerPrototypes& prototypes() {
  static FeedbackControllerPrototypes the_map;
  return the_map;
}

}  // namespace ctrl_more
