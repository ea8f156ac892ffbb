#include "coglab_controllers/ros/feedback_reconfigure.hpp"

#include <algorithm>
#include <set>

namespace coglab_controllers {
namespace {

constexpr double kUnbounded = 1e6;  // replaces infinity, which a slider cannot show

/// Name of an element of a gain, a valid Python identifier.
std::string nameOf(const ctrl_more::GainSpec& gain, int element) {
  return gain.size == 1 ? gain.name : gain.name + "_" + std::to_string(element);
}

std::vector<ReconfigureField> fieldsOf(const ctrl_more::FeedbackControllersManager& feedback,
                                       const std::string& name) {
  std::vector<ReconfigureField> fields;
  const std::map<std::string, std::vector<double>> now = feedback.getGains(name).all();
  for (const ctrl_more::GainSpec& gain : feedback.describe(name).gains) {
    for (int i = 0; i < gain.size; ++i) {
      const double value = now.at(gain.name)[i];
      const double first = i < static_cast<int>(gain.initial.size()) ? gain.initial[i] : value;
      fields.push_back({nameOf(gain, i), gain.text + " (" + gain.unit + ")", value,
                        std::max(gain.min, -kUnbounded), std::min(gain.max, kUnbounded), first});
    }
  }
  return fields;
}

Answer setGains(ControllerManager& manager, const std::string& name,
                const std::map<std::string, double>& changed) {
  const auto lock = manager.lockRequests();
  ctrl_more::FeedbackControllersManager& feedback = manager.feedback();
  std::map<std::string, std::vector<double>> gains = feedback.getGains(name).all();
  std::set<std::string> unknown;
  for (const auto& [field, value] : changed) unknown.insert(field);
  for (const ctrl_more::GainSpec& gain : feedback.describe(name).gains) {
    for (int i = 0; i < gain.size; ++i) {
      const auto found = changed.find(nameOf(gain, i));
      if (found == changed.end()) continue;
      gains[gain.name][i] = found->second;
      unknown.erase(found->first);
    }
  }
  if (!unknown.empty()) {
    return Answer::invalid("'" + name + "' has no gain named " + *unknown.begin() +
                           "; the service describe lists its gains");
  }
  const ctrl_more::Status status = feedback.setGains(name, gains);
  if (!status.ok()) return Answer::invalid(status.message());
  feedback.waitAdopted(status.generation(), manager.planTimeout());
  return {};
}

}  // namespace

FeedbackReconfigure::FeedbackReconfigure(const ros::NodeHandle& node, ControllerManager& manager)
    : node_(node), manager_(manager) {
  refresh();
}

void FeedbackReconfigure::refresh() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ctrl_more::FeedbackControllersManager& feedback = manager_.feedback();
  std::set<std::string> loaded;
  for (const ctrl_more::ControllerStatus& one : feedback.statusAll()) {
    if (feedback.describe(one.name).gains.empty()) continue;
    loaded.insert(one.name);
    auto& server = servers_[one.name];
    if (server) {
      server->publish();
      continue;
    }
    const std::string name = one.name;
    server = std::make_unique<ReconfigureServer>(
        ros::NodeHandle(node_, name), [&feedback, name] { return fieldsOf(feedback, name); },
        [this, name](const auto& changed) { return setGains(manager_, name, changed); });
  }
  for (auto one = servers_.begin(); one != servers_.end();) {
    one = loaded.count(one->first) != 0 ? std::next(one) : servers_.erase(one);
  }
}

}  // namespace coglab_controllers
