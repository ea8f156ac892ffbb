// Loading and unloading of a FeedbackControllersManager.
#include <algorithm>
#include <filesystem>
#include <map>
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

// The names of a list file that are blocks of controllers.
std::vector<std::string> blocksOf(const ConfigNode& list) {
  std::vector<std::string> blocks;
  for (const auto& entry : list.entries()) {
    if (std::find(kFileKeys.begin(), kFileKeys.end(), entry.first) != kFileKeys.end()) continue;
    if (entry.second.kind() != ConfigNode::Kind::Map) {
      throw entry.second.error("'" + entry.first + "' is neither a block of a controller nor a " +
                               "known key" + suggestion(entry.first, kFileKeys));
    }
    blocks.push_back(entry.first);
  }
  return blocks;
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

// Puts everything that loading changes back at its end, unless it is kept. A controller that is
// refused half-way must not leave keys behind in the stores; once they are frozen it cannot, and
// the cycle may be using them.
class FeedbackControllersManager::Undo {
 public:
  explicit Undo(FeedbackControllersManager& manager)
      : manager_(manager),
        members_(manager.members_.size()),
        order_(manager.order_),
        profiles_(manager.profiles_),
        refuse_shared_(manager.refuse_shared_) {
    if (!manager_.robot_.frozen()) robot_.emplace(manager_.robot_);
    if (!manager_.control_.frozen()) control_.emplace(manager_.control_);
  }
  ~Undo() {
    if (kept_) return;
    auto& members = manager_.members_;
    for (std::size_t i = members_; i < members.size(); ++i) members[i]->slot->setOwner(nullptr);
    members.erase(members.begin() + static_cast<std::ptrdiff_t>(members_), members.end());
    manager_.order_.swap(order_);
    manager_.profiles_.swap(profiles_);
    manager_.refuse_shared_ = refuse_shared_;
    if (robot_) manager_.robot_ = std::move(*robot_);
    if (control_) manager_.control_ = std::move(*control_);
  }
  Undo(const Undo&) = delete;
  Undo& operator=(const Undo&) = delete;
  void keep() { kept_ = true; }

 private:
  FeedbackControllersManager& manager_;
  std::size_t members_;
  std::vector<std::string> order_;
  std::map<std::string, std::vector<std::string>> profiles_;
  bool refuse_shared_;
  std::optional<RobotStates> robot_;
  std::optional<ControlStates> control_;
  bool kept_ = false;
};

// The cycle is offered the whole list at once, or nothing of it.
LoadReport FeedbackControllersManager::load(const ConfigNode& list, const std::string& base,
                                            bool strict) {
  const Lock lock(mutex_);
  LoadReport report;
  Undo undo(*this);
  try {
    readList(list, base, report);
  } catch (const std::exception& e) {
    report.errors.push_back(e.what());
  }
  for (const std::string& error : report.errors) logger_->log(LogLevel::Error, name_, error);
  if (strict && !report.errors.empty()) {
    report.loaded.clear();
    return report;
  }
  if (!report.loaded.empty()) publish(draftOf());
  undo.keep();
  return report;
}

// Adds what a list names, without telling the cycle. What cannot be loaded is reported.
void FeedbackControllersManager::readList(const ConfigNode& list, const std::string& base,
                                          LoadReport& report) {
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
  const std::vector<std::string> blocks = blocksOf(list);
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
      report.errors.push_back(e.what());
    }
  }
  if (const ConfigNode* node = list.find("profiles")) {
    if (node->kind() != ConfigNode::Kind::Map) throw node->error("profiles expects a map");
    for (const auto& entry : node->entries()) {
      const Status status =
          setProfileLocked(entry.first, entry.second.texts("profile '" + entry.first + "'"));
      if (!status) report.errors.push_back(entry.second.place() + ": " + status.message());
    }
  }
}

Status FeedbackControllersManager::loadController(const std::string& name,
                                                  const ControllerEntry& entry) {
  const Lock lock(mutex_);
  return loadLocked(name, entry);
}

// Without `offer` the cycle is not told: the caller publishes.
Status FeedbackControllersManager::loadLocked(const std::string& name,
                                              const ControllerEntry& entry, bool offer) {
  // A library that only an outdated plan holds is closed, so that a new build of it is loaded.
  collect();
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
  // Until the end of this function: what initialize() throws may live in the library.
  const std::shared_ptr<PluginLibrary> library = instance.library;
  Undo undo(*this);
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
    members_.push_back(std::move(member));
    Draft draft = draftOf();
    draft.order.push_back(name);
    Status status = checkExclusive(draft);
    if (!status) return Status::failure("controller '" + name + "': " + status.message());
    if (offer) {
      status = publish(std::move(draft));
    } else {
      order_ = std::move(draft.order);
    }
    members_.back()->slot->setOwner(this);
    ++next_owner_;
    undo.keep();
    return status;
  } catch (const std::exception& e) {
    return Status::failure("controller '" + name + "': " + e.what());
  } catch (...) {
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
  Draft draft = draftOf();
  draft.states.erase(draft.states.begin() + i);
  draft.order.erase(std::find(draft.order.begin(), draft.order.end(), name));
  std::unique_ptr<Member> out = std::move(members_[i]);
  members_.erase(members_.begin() + i);
  try {
    const Status status = publish(std::move(draft));
    out->slot->setOwner(nullptr);
    return status;
  } catch (...) {
    members_.insert(members_.begin() + i, std::move(out));  // its room is still there
    throw;
  }
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
  std::vector<std::string> list = controllers;
  profiles_[profile] = std::move(list);
  return {};
}

}  // namespace ctrl_more
