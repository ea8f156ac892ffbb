#include "ctrl_more/prototypes.hpp"

namespace ctrl_more {

bool FeedbackControllerPrototypes::insert(
    const std::pair<const std::string, FeedbackControllerMaker>& entry) {
  const bool inserted = entry.second != nullptr && makers_.insert(entry).second;
  if (!inserted) refused_.push_back(entry.first);
  return inserted;
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
  std::vector<std::string> names;
  names.swap(refused_);
  return names;
}

FeedbackControllerPrototypes& prototypes() {
  static FeedbackControllerPrototypes the_map;
  return the_map;
}

}  // namespace ctrl_more
