// Loading and unloading of a FeedbackControllersManager.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "controller_config.hpp"
#include "manager_members.hpp"

namespace ctrl_more {
namespace {

const std::vector<std::string> kFileKeys = {"loadControllers", "profiles", "searchPath",
                                            "sharedSignals"};
const std::vector<std::string> kBlockKeys = {"libPath",    "configFile", "type",   "enabled",
                                             "overrun_us", "on_fault",   "blend_s"};

StopPolicy readPolicy(const ConfigNode& node) {
  const std::string text = node.text("on_fault");
  if (text == "hold") return StopPolicy::Hold;
  if (text == "fade") return StopPolicy::Fade;
  if (text == "zero") return StopPolicy::Zero;
  throw node.error("on_fault cannot be '" + text + "'" +
                   suggestion(text, {"hold", "fade", "zero"}));
}

double readPositive(const ConfigNode& node, const std::string& what) {
  const double value = node.number(what);
  if (value < 0.0) throw node.error(what + " must not be negative");
  return value;
}

ControllerEntry readEntry(const std::string& name, const ConfigNode& block,
                          const SearchPath& files) {
  block.requireKeys("controller '" + name + "'", kBlockKeys);
  ControllerEntry entry;
  const auto locate = [&](const ConfigNode& node, const char* key) {
    try {
      return files.find(node.text(key));
    } catch (const ConfigError&) {
      throw;
    } catch (const std::exception& e) {
      throw node.error(std::string(key) + " of '" + name + "': " + e.what());
    }
  };
  if (const ConfigNode* node = block.find("type")) entry.type = node->text("type");
  if (const ConfigNode* node = block.find("enabled")) entry.enabled = node->boolean("enabled");
  if (const ConfigNode* node = block.find("overrun_us")) {
    entry.overrun_us = readPositive(*node, "overrun_us");
  }
  if (const ConfigNode* node = block.find("blend_s")) {
    entry.blend_s = readPositive(*node, "blend_s");
  }
  if (const ConfigNode* node = block.find("on_fault")) entry.on_fault = readPolicy(*node);
  if (const ConfigNode* node = block.find("configFile")) {
    entry.config_file = locate(*node, "configFile");
  }
  if (const ConfigNode* node = block.find("libPath")) entry.library = locate(*node, "libPath");
  if (entry.library.empty()) {
    const std::string type = entry.type.empty() ? name : entry.type;
    try {
      entry.library = files.findLibraryOf(type);
    } catch (const std::exception& e) {
      throw block.error("controller '" + name + "': " + e.what());
    }
    entry.type = type;
  }
  return entry;
}

}  // namespace

std::string LoadReport::text() const {
  std::string all;
  for (const std::string& error : errors) all += (all.empty() ? "" : "\n") + error;
  return all;
}

LoadReport FeedbackControllersManager::load(const std::string& file, bool strict) {
  try {
    const std::string base = std::filesystem::path(file).parent_path().string();
    return load(ConfigNode::fromFile(file), base, strict);
  } catch (const std::exception& e) {
    LoadReport report;
    report.errors.push_back(e.what());
    logger_->log(LogLevel::Error, name_, e.what());
    return report;
  }
}

LoadReport FeedbackControllersManager::load(const ConfigNode& list, const std::string& base,
                                            bool strict) {
  const Lock lock(mutex_);
  LoadReport report;
  const auto refuse = [&](const std::string& text) {
    report.errors.push_back(text);
    logger_->log(LogLevel::Error, name_, text);
  };
  // The cycle is offered the whole list at once, or nothing of it.
  const bool refuse_shared_before = refuse_shared_;
  const auto profiles_before = profiles_;
  const auto order_before = order_;
  const std::size_t members_before = members_.size();
  std::optional<std::pair<RobotStates, ControlStates>> stores_before;
  if (!robot_.frozen()) stores_before.emplace(robot_, control_);
  try {
    if (list.kind() != ConfigNode::Kind::Map) throw list.error("a list file must be a map");
    const ConfigNode* names = list.find("loadControllers");
    if (!names) throw list.error("a list file needs loadControllers: [names]");
    std::vector<std::string> folders;
    if (const ConfigNode* node = list.find("searchPath")) folders = node->texts("searchPath");
    if (const ConfigNode* node = list.find("sharedSignals")) {
      const std::string policy = node->text("sharedSignals");
      if (policy != "cascade" && policy != "refuse") {
        throw node->error("sharedSignals cannot be '" + policy + "'" +
                          suggestion(policy, {"cascade", "refuse"}));
      }
      refuse_shared_ = policy == "refuse";
    }
    const SearchPath files(base, folders);
    std::vector<std::string> blocks;
    for (const auto& entry : list.entries()) {
      const bool reserved =
          std::find(kFileKeys.begin(), kFileKeys.end(), entry.first) != kFileKeys.end();
      if (reserved) continue;
      if (entry.second.kind() != ConfigNode::Kind::Map) {
        std::vector<std::string> known = kFileKeys;
        throw entry.second.error("'" + entry.first + "' is neither a block of a controller nor a " +
                                 "known key" + suggestion(entry.first, known));
      }
      blocks.push_back(entry.first);
    }
    if (names->kind() != ConfigNode::Kind::List) {
      throw names->error("loadControllers expects a list of names");
    }
    for (const ConfigNode& item : names->items()) {
      try {
        const std::string name = item.text("a name in loadControllers");
        const ConfigNode* block = list.find(name);
        if (!block || std::find(blocks.begin(), blocks.end(), name) == blocks.end()) {
          throw item.error("loadControllers lists '" + name + "', but there is no block '" + name +
                           ":'" + suggestion(name, blocks));
        }
        const ControllerEntry entry = readEntry(name, *block, files);
        const Status status = loadLocked(name, entry, false);
        if (!status) throw block->error(status.message());
        report.loaded.push_back(name);
      } catch (const std::exception& e) {
        refuse(e.what());
      }
    }
    if (const ConfigNode* node = list.find("profiles")) {
      if (node->kind() != ConfigNode::Kind::Map) throw node->error("profiles expects a map");
      for (const auto& entry : node->entries()) {
        const Status status = setProfileLocked(
            entry.first, entry.second.texts("profile '" + entry.first + "'"));
        if (!status) refuse(entry.second.place() + ": " + status.message());
      }
    }
  } catch (const std::exception& e) {
    refuse(e.what());
  }
  if (strict && !report.errors.empty()) {
    for (std::size_t i = members_before; i < members_.size(); ++i) {
      members_[i]->slot->setOwner(nullptr);
    }
    members_.erase(members_.begin() + static_cast<std::ptrdiff_t>(members_before), members_.end());
    order_ = order_before;
    profiles_ = profiles_before;
    refuse_shared_ = refuse_shared_before;
    if (stores_before) {
      robot_ = stores_before->first;
      control_ = stores_before->second;
    }
    report.loaded.clear();
  } else if (members_.size() > members_before) {
    publish(draftOf());
  }
  return report;
}

Status FeedbackControllersManager::loadController(const std::string& name,
                                                  const ControllerEntry& entry) {
  const Lock lock(mutex_);
  return loadLocked(name, entry);
}

// Without `offer` the cycle is not told: the caller publishes.
Status FeedbackControllersManager::loadLocked(const std::string& name,
                                              const ControllerEntry& entry, bool offer) {
  try {
    if (indexOf(name) >= 0) {
      return Status::failure("a controller named '" + name + "' is loaded already");
    }
    return take(makeController(entry.library, entry.type), name, entry, offer);
  } catch (const std::exception& e) {
    return Status::failure("controller '" + name + "': " + e.what());
  }
}

Status FeedbackControllersManager::addController(std::unique_ptr<FeedbackController> controller,
                                                 const std::string& name,
                                                 const ControllerEntry& entry) {
  const Lock lock(mutex_);
  if (!controller) return Status::failure("controller '" + name + "': there is no instance");
  ControllerInstance instance;
  instance.controller = std::move(controller);
  return take(std::move(instance), name, entry);
}

Status FeedbackControllersManager::take(ControllerInstance instance, const std::string& name,
                                        const ControllerEntry& entry, bool offer) {
  if (name.empty()) return Status::failure("a controller needs a name that is not empty");
  if (indexOf(name) >= 0) {
    return Status::failure("a controller named '" + name + "' is loaded already");
  }
  // A controller that is refused half-way must not leave keys behind in the stores. Once they are
  // frozen it cannot, and the cycle may be using them.
  std::optional<std::pair<RobotStates, ControlStates>> before;
  if (!robot_.frozen()) before.emplace(robot_, control_);
  const auto undo = [&] {
    if (!before) return;
    robot_ = before->first;
    control_ = before->second;
  };
  try {
    auto member = std::make_unique<Member>();
    member->name = name;
    member->entry = entry;
    member->slot = std::make_shared<ControllerSlot>(std::move(instance), name, entry, options_,
                                                    next_owner_);
    member->description = member->slot->controller().declaration();
    const ControllerConfig config =
        entry.config_file.empty()
            ? ControllerConfig(member->description)
            : readControllerConfig(member->description, ConfigNode::fromFile(entry.config_file));
    member->settings = config.settings;
    member->state.gains = std::make_shared<const GainValues>(config.gains);
    member->state.enabled = entry.enabled;
    member->slot->configure(config.gains, config.settings, robot_, control_, logger_,
                            &cycle_number_);
    member->slot->setOwner(this);
    members_.push_back(std::move(member));
    Draft draft = draftOf();
    draft.order.push_back(name);
    const Status status = checkExclusive(draft);
    if (!status) {
      members_.back()->slot->setOwner(nullptr);
      members_.pop_back();
      undo();
      return Status::failure("controller '" + name + "': " + status.message());
    }
    ++next_owner_;
    before_last_.reset();
    if (offer) return publish(draft);
    order_ = draft.order;
    return {};
  } catch (const std::exception& e) {
    undo();
    return Status::failure("controller '" + name + "': " + e.what());
  } catch (...) {
    undo();
    return Status::failure("controller '" + name +
                           "': initialize() threw something that is not a std::exception");
  }
}

Status FeedbackControllersManager::unload(const std::string& name) {
  const Lock lock(mutex_);
  return unloadLocked(name);
}

Status FeedbackControllersManager::unloadLocked(const std::string& name) {
  const int i = indexOf(name);
  if (i < 0) return Status::failure(unknownName(name));
  const Member& m = *members_[i];
  if (m.state.enabled || m.slot->activity() != Activity::Off) {
    return Status::failure("'" + name + "' is " +
                           (m.state.enabled ? "enabled" : nameOf(m.slot->activity())) +
                           "; disable it and wait until its correction has faded");
  }
  for (const auto& profile : profiles_) {
    const auto& list = profile.second;
    if (std::find(list.begin(), list.end(), name) != list.end()) {
      return Status::failure("'" + name + "' is part of profile '" + profile.first +
                             "'; change the profile first");
    }
  }
  m.slot->setOwner(nullptr);
  Draft draft = draftOf();
  draft.states.erase(draft.states.begin() + i);
  draft.order.erase(std::find(draft.order.begin(), draft.order.end(), name));
  members_.erase(members_.begin() + i);
  before_last_.reset();
  return publish(draft);
}

Status FeedbackControllersManager::setProfile(const std::string& profile,
                                              const std::vector<std::string>& controllers) {
  const Lock lock(mutex_);
  return setProfileLocked(profile, controllers);
}

Status FeedbackControllersManager::setProfileLocked(const std::string& profile,
                                                    const std::vector<std::string>& controllers) {
  if (profile.empty()) return Status::failure("a profile needs a name that is not empty");
  for (const std::string& name : controllers) {
    if (indexOf(name) < 0) {
      return Status::failure("profile '" + profile + "': " + unknownName(name));
    }
    if (std::count(controllers.begin(), controllers.end(), name) > 1) {
      return Status::failure("profile '" + profile + "': '" + name + "' appears twice");
    }
  }
  profiles_[profile] = controllers;
  return {};
}

}  // namespace ctrl_more
