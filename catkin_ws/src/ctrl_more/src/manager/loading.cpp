// Loading and unloading of a FeedbackControllersManager.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "ctrl_more/manager/feedback_controllers_manager.hpp"
#include "cycle/cycle_runner.hpp"
#include "description/controller_config.hpp"
#include "manager/list_file.hpp"
#include "manager/roster.hpp"

namespace ctrl_more {

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
        members_(manager.roster_->members.size()),
        order_(manager.roster_->order),
        profiles_(manager.roster_->profiles),
        refuse_shared_(manager.roster_->refuse_shared) {
    if (!manager_.robot_.frozen()) robot_.emplace(manager_.robot_);
    if (!manager_.control_.frozen()) control_.emplace(manager_.control_);
  }
  ~Undo() {
    if (kept_) return;
    Roster& roster = *manager_.roster_;
    while (roster.members.size() > members_) {
      roster.members.back()->slot->setOwner(nullptr);
      std::unique_ptr<Member> out;  // destroyed without the mutex
      const RosterLock lock(roster.mutex);
      out = std::move(roster.members.back());
      roster.members.pop_back();
    }
    {
      const RosterLock lock(roster.mutex);
      roster.order.swap(order_);
      roster.profiles.swap(profiles_);
      roster.refuse_shared = refuse_shared_;
    }
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
  Roster::Profiles profiles_;
  bool refuse_shared_;
  std::optional<RobotStates> robot_;
  std::optional<ControlStates> control_;
  bool kept_ = false;
};

// The cycle is offered the whole list at once, or nothing of it.
LoadReport FeedbackControllersManager::load(const ConfigNode& list, const std::string& base,
                                            bool strict) {
  LoadReport report;
  const ChangeLock lock(*roster_);
  if (!lock) {
    report.errors.push_back(ChangeLock::busy().message());
    return report;
  }
  Undo undo(*this);
  try {
    readList(ListFile(list, base), report);
  } catch (const std::exception& e) {
    report.errors.push_back(e.what());
  }
  for (const std::string& error : report.errors) logger_->log(LogLevel::Error, name_, error);
  if (strict && !report.errors.empty()) {
    report.loaded.clear();
    return report;
  }
  if (!report.loaded.empty()) publish(roster_->draft());
  undo.keep();
  return report;
}

// Adds what a list names, without telling the cycle. What cannot be loaded is reported.
void FeedbackControllersManager::readList(const ListFile& list, LoadReport& report) {
  if (list.refuseShared()) roster_->refuse_shared = *list.refuseShared();
  for (const ConfigNode& item : list.items()) {
    try {
      const ListFile::Controller listed = list.read(item);
      const Status status = loadNamed(listed.name, listed.entry, false);
      if (!status) throw listed.block->error(status.message());
      report.loaded.push_back(listed.name);
    } catch (const std::exception& e) {
      report.errors.push_back(e.what());
    }
  }
  const ConfigNode* profiles = list.profiles();
  if (!profiles) return;
  if (profiles->kind() != ConfigNode::Kind::Map) throw profiles->error("profiles expects a map");
  for (const auto& entry : profiles->entries()) {
    const Status status =
        setProfile(entry.first, entry.second.texts("profile '" + entry.first + "'"));
    if (!status) report.errors.push_back(entry.second.place() + ": " + status.message());
  }
}

Status FeedbackControllersManager::loadController(const std::string& name,
                                                  const ControllerEntry& entry) {
  return loadNamed(name, entry, true);
}

// Without `offer` the cycle is not told: the caller publishes, and holds the lock of changes.
Status FeedbackControllersManager::loadNamed(const std::string& name, const ControllerEntry& entry,
                                             bool offer) {
  try {
    {
      const ChangeLock lock(*roster_);
      if (!lock) return ChangeLock::busy();
      // A library that only an outdated plan holds is closed, so that a new build of it is loaded.
      runner_->plans().collect();
      if (roster_->indexOf(name) >= 0) {
        return Status::failure("a controller named '" + name + "' is loaded already");
      }
    }
    // Without the lock: a library may take seconds.
    ControllerInstance instance = makeController(entry.library, entry.type);
    const ChangeLock lock(*roster_);
    if (!lock) return ChangeLock::busy();
    return take(std::move(instance), name, entry, offer);
  } catch (const std::exception& e) {
    return Status::failure("controller '" + name + "': " + e.what());
  }
}

Status FeedbackControllersManager::addController(std::unique_ptr<FeedbackController> controller,
                                                 const std::string& name,
                                                 const ControllerEntry& entry) {
  const ChangeLock lock(*roster_);
  if (!lock) return ChangeLock::busy();
  if (!controller) return Status::failure("controller '" + name + "': there is no instance");
  ControllerInstance instance;
  instance.controller = std::move(controller);
  return take(std::move(instance), name, entry, true);
}

Status FeedbackControllersManager::take(ControllerInstance instance, const std::string& name,
                                        const ControllerEntry& entry, bool offer) {
  if (name.empty()) return Status::failure("a controller needs a name that is not empty");
  if (roster_->indexOf(name) >= 0) {
    return Status::failure("a controller named '" + name + "' is loaded already");
  }
  // Until the end of this function: what initialize() throws may live in the library.
  const std::shared_ptr<PluginLibrary> library = instance.library;
  Undo undo(*this);
  try {
    auto member = std::make_unique<Member>();
    member->name = name;
    member->entry = entry;
    member->slot =
        std::make_shared<ControllerSlot>(std::move(instance), name, entry, options_, next_owner_);
    member->description = member->slot->controller().declaration();
    const ControllerConfig config =
        entry.config_file.empty()
            ? ControllerConfig(member->description)
            : readControllerConfig(member->description, ConfigNode::fromFile(entry.config_file));
    member->settings = config.settings;
    member->state.gains = std::make_shared<const GainValues>(config.gains);
    member->state.enabled = entry.enabled;
    member->slot->configure(config.gains, config.settings, robot_, control_, logger_,
                            &runner_->number());
    {
      const RosterLock write(roster_->mutex);
      roster_->members.push_back(std::move(member));
    }
    Draft draft = roster_->draft();
    draft.order.push_back(name);
    Status status = roster_->checkShared(draft);
    if (!status)
      return Status::failure("controller '" + name + "': " + status.message(), status.cause());
    if (offer) {
      status = publish(std::move(draft));
    } else {
      const RosterLock write(roster_->mutex);
      roster_->order = std::move(draft.order);
    }
    roster_->members.back()->slot->setOwner(this);
    ++next_owner_;
    undo.keep();
    return status;
  } catch (const std::exception& e) {
    return Status::failure("controller '" + name + "': " + e.what());
  } catch (...) {
    return Status::failure(
        "controller '" + name + "': initialize() threw something that is not a std::exception",
        Cause::Fault);
  }
}

Status FeedbackControllersManager::unload(const std::string& name) {
  const ChangeLock lock(*roster_);
  if (!lock) return ChangeLock::busy();
  auto& members = roster_->members;
  const int i = roster_->indexOf(name);
  if (i < 0) return Status::failure(roster_->unknownName(name), Cause::UnknownName);
  const Member& m = *members[i];
  if (m.state.enabled || m.slot->activity() != Activity::Off) {
    return Status::failure("'" + name + "' is " +
                               (m.state.enabled ? "enabled" : nameOf(m.slot->activity())) +
                               "; disable it and wait until its correction has faded",
                           Cause::Busy);
  }
  for (const auto& profile : roster_->profiles) {
    const auto& list = profile.second;
    if (std::find(list.begin(), list.end(), name) != list.end()) {
      return Status::failure(
          "'" + name + "' is part of profile '" + profile.first + "'; change the profile first",
          Cause::Busy);
    }
  }
  Draft draft = roster_->draft();
  draft.states.erase(draft.states.begin() + i);
  draft.order.erase(std::find(draft.order.begin(), draft.order.end(), name));
  std::vector<std::string> order = draft.order;
  std::unique_ptr<Member> out;  // destroyed without the mutex
  {
    const RosterLock write(roster_->mutex);
    out = std::move(members[i]);
    members.erase(members.begin() + i);
    roster_->order.swap(order);
  }
  try {
    const Status status = publish(std::move(draft));
    out->slot->setOwner(nullptr);
    return status;
  } catch (...) {
    const RosterLock write(roster_->mutex);
    members.insert(members.begin() + i, std::move(out));  // its room is still there
    roster_->order.swap(order);
    throw;
  }
}

Status FeedbackControllersManager::setProfile(const std::string& profile,
                                              const std::vector<std::string>& controllers) {
  const ChangeLock lock(*roster_);
  if (!lock) return ChangeLock::busy();
  const RosterLock write(roster_->mutex);
  return roster_->setProfile(profile, controllers);
}

}  // namespace ctrl_more
