#include "ctrl_more/feedback_controllers_manager.hpp"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "coglab_rt/clock.hpp"
#include "coglab_rt/triple_buffer.hpp"
#include "ctrl_more/description/configuration.hpp"
#include "manager/controller_list.hpp"
#include "manager/list_file.hpp"
#include "manager/plan.hpp"
#include "manager/slot.hpp"

namespace ctrl_more {

/// The cycle's side of a manager. It adopts plans and runs the controllers of a stage in order.
///
/// begin() to end() do not allocate, lock or throw.
class CycleSide {
 public:
  CycleSide(RobotStates& robot, ControlStates& control, const ManagerOptions& options,
            Logger* logger)
      : robot_(robot),
        control_(control),
        options_(options),
        log_(logger, "FeedbackControllersManager", &number),
        original_(0, control.controlPeriod(), logger) {}

  /// Fixes the layout of both stores and allocates the memory of the cycle.
  void freeze() {
    if (laid_out_ && original_.dataSize() == control_.dataSize()) return;
    robot_.freeze();
    control_.freeze();
    original_ = control_;
    compared_.assign(control_.dataSize(), 0.0);
    laid_out_ = true;
  }

  /// Starts a cycle with the newest plan.
  void begin(const Cycle& cycle) noexcept {
    cycle_ = cycle;
    number.store(cycle.number, std::memory_order_relaxed);
    // The stores may have been fixed by another manager, or by the host.
    freeze();
    adopt(plans.take());
  }

  /// Adopts the prepared plan, if any.
  void adoptPrepared() noexcept {
    const Plan* first = plans.takePrepared();
    if (!first) return;
    // An older plan may have been offered since begin(). It must be adopted first.
    const Plan* second = plans.take();
    if (second && second->generation < first->generation) std::swap(first, second);
    adopt(first);
    adopt(second);
  }

  /// See FeedbackControllersManager::letGo().
  void letGo(bool let_go) noexcept { let_go_ = let_go; }

  /// Copies the references to `original`, then runs the controllers of a stage in order.
  void runStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept {
    if (!plan_ || plan_->stages[static_cast<int>(stage)].empty()) return;
    if (control.dataSize() != original_.dataSize()) {
      CTRL_MORE_LOG(log_, Error,
                    "control states of {} numbers were given, {} expected: nothing run",
                    control.dataSize(), original_.dataSize());
      return;
    }
    original_.copyValuesFrom(control);
    recorded_ = true;
    StageRun run{cycle_,
                 robot,
                 original_,
                 control,
                 options_.check_undeclared ? &compared_ : nullptr,
                 options_.timed || plan_->timed,
                 let_go_,
                 records_.backIndex(),
                 0};
    if (run.timed) run.boundary_ns = coglab_rt::steadyNow();
    for (Slot* slot : plan_->stages[static_cast<int>(stage)]) slot->run(run);
  }

  /// Closes the cycle.
  void end() noexcept {
    if (!recorded_) return;
    records_.write(cycle_.number);
    recorded_ = false;
  }

  /// Newest complete buffer of records. One reader at a time.
  /// @param cycle receives the number of its cycle
  unsigned acquireRecords(std::uint64_t& cycle) {
    records_.take();
    cycle = records_.front();
    return records_.frontIndex();
  }

  std::atomic<std::uint64_t> number{0};  ///< cycle number; before the plans, whose slots log it
  PlanQueue plans;

 private:
  void adopt(const Plan* plan) noexcept {
    if (!plan) return;
    plan_ = plan;
    for (const PlanEntry& entry : plan->entries) entry.slot->adopt(entry);
    plans.acknowledge(*plan);
  }

  RobotStates& robot_;
  ControlStates& control_;
  const ManagerOptions options_;
  LogSource log_;
  // Cycle number of each of a slot's three record buffers.
  coglab_rt::TripleBuffer<std::uint64_t> records_{0};
  bool recorded_ = false;  // true if this cycle has records
  bool laid_out_ = false;  // freeze() was called
  bool let_go_ = false;    // no controller runs
  const Plan* plan_ = nullptr;
  Cycle cycle_;
  ControlStates original_;
  std::vector<double> compared_;  // for the test mode
};

namespace {

// Names of the used signals, without duplicates.
template <typename Uses>
std::vector<std::string> namesOf(const ControllerList& list, bool enabled_only, Uses uses) {
  std::set<std::string> used;
  for (const auto& controller : list.controllers) {
    if (enabled_only && !controller->state.enabled) continue;
    for (const auto& use : uses(*controller->slot)) used.insert(use.name());
  }
  return {used.begin(), used.end()};
}

}  // namespace

FeedbackControllersManager::FeedbackControllersManager(RobotStates& robot, ControlStates& control,
                                                       const ManagerOptions& options,
                                                       Logger* logger)
    : robot_(robot),
      control_(control),
      options_(options),
      logger_(logger ? logger : &Logger::standard()),
      cycle_(std::make_unique<CycleSide>(robot, control, options, logger_)),
      list_(std::make_unique<ControllerList>()) {}

FeedbackControllersManager::~FeedbackControllersManager() {
  for (auto& controller : list_->controllers) controller->slot->setOwner(nullptr);
}

// The cycle

void FeedbackControllersManager::freeze() { cycle_->freeze(); }

void FeedbackControllersManager::beginCycle(const Cycle& cycle) noexcept { cycle_->begin(cycle); }

void FeedbackControllersManager::adoptPrepared() noexcept { cycle_->adoptPrepared(); }

void FeedbackControllersManager::letGo(bool let_go) noexcept { cycle_->letGo(let_go); }

void FeedbackControllersManager::updateStage(Stage stage, const RobotStates& robot,
                                             ControlStates& control) noexcept {
  cycle_->runStage(stage, robot, control);
}

void FeedbackControllersManager::endCycle() noexcept { cycle_->end(); }

void FeedbackControllersManager::update(const Cycle& cycle, const RobotStates& robot,
                                        ControlStates& control) noexcept {
  beginCycle(cycle);
  updateStage(Stage::Task, robot, control);
  updateStage(Stage::Joint, robot, control);
  endCycle();
}

void FeedbackControllersManager::update(const RobotStates& robot, ControlStates* control) noexcept {
  if (!control) return;
  update({robot.newestStamp(), control->controlPeriod(), cycle_->number + 1}, robot, *control);
}

// Changes

Status FeedbackControllersManager::apply(const Change& change) {
  return this->change(change, false);
}

Status FeedbackControllersManager::prepare(const Change& change) {
  return this->change(change, true);
}

// All steps that can fail come before the publication, so a failure has no effect.
Status FeedbackControllersManager::change(const Change& change, bool prepared) {
  const ChangeLock lock(*list_);
  if (!lock) return ChangeLock::busy();
  PendingChange pending(*list_);
  const Status made = pending.make(change);
  if (!made) return made;
  std::string note = made.message();
  auto before = std::make_unique<PendingChange>(*list_);
  Status status = publish(std::move(pending), prepared);
  before_last_ = std::move(before);
  status.note(std::move(note));
  return status;
}

// Accepts a change and offers it to the cycle as a plan. If memory runs out, nothing changes.
Status FeedbackControllersManager::publish(PendingChange change, bool prepared) {
  PlanQueue& plans = cycle_->plans;
  plans.store(change.plan(plans.generation() + 1));
  return commit(std::move(change), prepared);
}

// The part of publish() that cannot fail. The plan is already stored.
Status FeedbackControllersManager::commit(PendingChange change, bool prepared) noexcept {
  {
    const ListLock lock(list_->mutex);
    list_->accept(std::move(change));
  }
  before_last_.reset();
  cycle_->plans.offer(prepared);
  return Status::published(cycle_->plans.generation());
}

bool FeedbackControllersManager::waitAdopted(std::uint64_t generation, double timeout_s) const {
  return cycle_->plans.wait(generation, timeout_s);
}

Status FeedbackControllersManager::withdraw(std::uint64_t generation) {
  const ChangeLock lock(*list_);
  if (!lock) return ChangeLock::busy();
  PlanQueue& plans = cycle_->plans;
  if (generation != plans.generation() || !before_last_ ||
      before_last_->states.size() != list_->controllers.size()) {
    return Status::failure("plan " + std::to_string(generation) +
                           " cannot be withdrawn: the newest one is " +
                           std::to_string(plans.generation()));
  }
  plans.store(before_last_->plan(generation + 1));
  if (!plans.retract()) {
    return Status::failure("plan " + std::to_string(generation) + " is adopted already",
                           Cause::Busy);
  }
  const std::unique_ptr<PendingChange> back = std::move(before_last_);
  return commit(std::move(*back), false);
}

// Loading and unloading

std::string LoadReport::text() const {
  std::string all;
  for (const std::string& error : errors) all += (all.empty() ? "" : "\n") + error;
  return all;
}

LoadReport FeedbackControllersManager::load(const std::string& file, bool strict) {
  try {
    const std::string base = std::filesystem::absolute(file).parent_path().string();
    return load(ConfigNode::fromFile(file), base, strict);
  } catch (const std::exception& e) {
    LoadReport report;
    report.errors.push_back(e.what());
    logger_->log(LogLevel::Error, name_, e.what());
    return report;
  }
}

// Restores the state before loading in its destructor, unless keep() was called. A refused
// controller must not leave keys in the stores. Frozen stores are not restored: they cannot get new
// keys, and the cycle may be using them.
class FeedbackControllersManager::Undo {
 public:
  explicit Undo(FeedbackControllersManager& manager)
      : manager_(manager),
        controllers_(manager.list_->controllers.size()),
        order_(manager.list_->order),
        profiles_(manager.list_->profiles),
        refuse_shared_(manager.list_->refuse_shared) {
    if (!manager_.robot_.frozen()) robot_.emplace(manager_.robot_);
    if (!manager_.control_.frozen()) control_.emplace(manager_.control_);
  }
  ~Undo() {
    if (kept_) return;
    ControllerList& list = *manager_.list_;
    while (list.controllers.size() > controllers_) {
      list.controllers.back()->slot->setOwner(nullptr);
      std::unique_ptr<LoadedController> out;  // destroyed without the mutex
      const ListLock lock(list.mutex);
      out = std::move(list.controllers.back());
      list.controllers.pop_back();
    }
    {
      const ListLock lock(list.mutex);
      list.order.swap(order_);
      list.profiles.swap(profiles_);
      list.refuse_shared = refuse_shared_;
    }
    if (robot_) manager_.robot_ = std::move(*robot_);
    if (control_) manager_.control_ = std::move(*control_);
  }
  Undo(const Undo&) = delete;
  Undo& operator=(const Undo&) = delete;
  void keep() { kept_ = true; }

 private:
  FeedbackControllersManager& manager_;
  std::size_t controllers_;
  std::vector<std::string> order_;
  ControllerList::Profiles profiles_;
  bool refuse_shared_;
  std::optional<RobotStates> robot_;
  std::optional<ControlStates> control_;
  bool kept_ = false;
};

// Offers the whole list to the cycle at once, or nothing of it.
LoadReport FeedbackControllersManager::load(const ConfigNode& list, const std::string& base,
                                            bool strict) {
  LoadReport report;
  const ChangeLock lock(*list_);
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
  if (!report.loaded.empty()) publish(PendingChange(*list_));
  undo.keep();
  return report;
}

// Adds the controllers of a list without publishing them to the cycle. Reports the errors.
void FeedbackControllersManager::readList(const ListFile& list, LoadReport& report) {
  if (list.refuseShared()) list_->refuse_shared = *list.refuseShared();
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

// Without `offer` the caller publishes the change and holds the lock of changes.
Status FeedbackControllersManager::loadNamed(const std::string& name, const ControllerEntry& entry,
                                             bool offer) {
  try {
    {
      const ChangeLock lock(*list_);
      if (!lock) return ChangeLock::busy();
      // Closes libraries that only outdated plans use, so that a new build can be loaded.
      cycle_->plans.collect();
      if (list_->indexOf(name) >= 0) {
        return Status::failure("a controller named '" + name + "' is loaded already");
      }
    }
    // Without the lock: loading a library may take seconds.
    ControllerInstance instance = makeController(entry.library, entry.type);
    const ChangeLock lock(*list_);
    if (!lock) return ChangeLock::busy();
    return take(std::move(instance), name, entry, offer);
  } catch (const std::exception& e) {
    return Status::failure("controller '" + name + "': " + e.what());
  }
}

Status FeedbackControllersManager::addController(std::unique_ptr<FeedbackController> controller,
                                                 const std::string& name,
                                                 const ControllerEntry& entry) {
  const ChangeLock lock(*list_);
  if (!lock) return ChangeLock::busy();
  if (!controller) return Status::failure("controller '" + name + "': there is no instance");
  ControllerInstance instance;
  instance.controller = std::move(controller);
  return take(std::move(instance), name, entry, true);
}

Status FeedbackControllersManager::take(ControllerInstance instance, const std::string& name,
                                        const ControllerEntry& entry, bool offer) {
  if (name.empty()) return Status::failure("a controller needs a name that is not empty");
  if (list_->indexOf(name) >= 0) {
    return Status::failure("a controller named '" + name + "' is loaded already");
  }
  // Kept until the end of this function: the library may contain the exception of initialize().
  const std::shared_ptr<PluginLibrary> library = instance.library;
  Undo undo(*this);
  try {
    auto controller = std::make_unique<LoadedController>();
    controller->name = name;
    controller->entry = entry;
    controller->slot =
        std::make_shared<Slot>(std::move(instance), name, entry, options_, next_owner_);
    controller->description = controller->slot->controller().declaration();
    const ControllerConfig config =
        entry.config_file.empty() ? ControllerConfig(controller->description)
                                  : readControllerConfig(controller->description,
                                                         ConfigNode::fromFile(entry.config_file));
    controller->settings = config.settings;
    controller->state.gains = std::make_shared<const GainValues>(config.gains);
    controller->state.enabled = entry.enabled;
    controller->slot->configure(config.gains, config.settings, robot_, control_, logger_,
                                &cycle_->number);
    {
      const ListLock write(list_->mutex);
      list_->controllers.push_back(std::move(controller));
    }
    PendingChange change(*list_);
    change.order.push_back(name);
    Status status = change.checkShared();
    if (!status)
      return Status::failure("controller '" + name + "': " + status.message(), status.cause());
    if (offer) {
      status = publish(std::move(change));
    } else {
      const ListLock write(list_->mutex);
      list_->order = std::move(change.order);
    }
    list_->controllers.back()->slot->setOwner(this);
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
  const ChangeLock lock(*list_);
  if (!lock) return ChangeLock::busy();
  auto& controllers = list_->controllers;
  const int i = list_->indexOf(name);
  if (i < 0) return Status::failure(list_->unknownName(name), Cause::UnknownName);
  const LoadedController& m = *controllers[i];
  if (m.state.enabled || m.slot->activity() != Activity::Off) {
    return Status::failure("'" + name + "' is " +
                               (m.state.enabled ? "enabled" : nameOf(m.slot->activity())) +
                               "; disable it and wait until its correction has faded",
                           Cause::Busy);
  }
  for (const auto& profile : list_->profiles) {
    const auto& list = profile.second;
    if (std::find(list.begin(), list.end(), name) != list.end()) {
      return Status::failure(
          "'" + name + "' is part of profile '" + profile.first + "'; change the profile first",
          Cause::Busy);
    }
  }
  PendingChange change(*list_);
  change.states.erase(change.states.begin() + i);
  change.order.erase(std::find(change.order.begin(), change.order.end(), name));
  std::vector<std::string> order = change.order;
  std::unique_ptr<LoadedController> out;  // destroyed without the mutex
  {
    const ListLock write(list_->mutex);
    out = std::move(controllers[i]);
    controllers.erase(controllers.begin() + i);
    list_->order.swap(order);
  }
  try {
    const Status status = publish(std::move(change));
    out->slot->setOwner(nullptr);
    return status;
  } catch (...) {
    const ListLock write(list_->mutex);
    controllers.insert(controllers.begin() + i, std::move(out));  // needs no allocation
    list_->order.swap(order);
    throw;
  }
}

Status FeedbackControllersManager::setProfile(const std::string& profile,
                                              const std::vector<std::string>& controllers) {
  const ChangeLock lock(*list_);
  if (!lock) return ChangeLock::busy();
  const ListLock write(list_->mutex);
  return list_->setProfile(profile, controllers);
}

// Queries

CycleRecord FeedbackControllersManager::lastCycle() const {
  const ListLock lock(list_->mutex);
  CycleRecord record;
  const unsigned buffer = cycle_->acquireRecords(record.cycle);
  for (const std::string& name : list_->order) {
    list_->at(name).slot->addRecord(control_, buffer, record);
  }
  return record;
}

bool FeedbackControllersManager::isEnabled(const std::string& name) const {
  const ListLock lock(list_->mutex);
  return list_->at(name).state.enabled;
}

bool FeedbackControllersManager::isPaused(const std::string& name) const {
  const ListLock lock(list_->mutex);
  const LoadedController& controller = list_->at(name);
  return !controller.state.reasons.empty() || controller.slot->fault() != FaultKind::None;
}

GainValues FeedbackControllersManager::getGains(const std::string& name) const {
  const ListLock lock(list_->mutex);
  return *list_->at(name).state.gains;
}

bool FeedbackControllersManager::has(const std::string& name) const {
  const ListLock lock(list_->mutex);
  return list_->indexOf(name) >= 0;
}

std::vector<std::string> FeedbackControllersManager::getControllersNames() const {
  const ListLock lock(list_->mutex);
  return list_->names();
}

std::vector<std::string> FeedbackControllersManager::getExecutionOrder() const {
  const ListLock lock(list_->mutex);
  return list_->order;
}

std::vector<std::string> FeedbackControllersManager::getProfiles() const {
  const ListLock lock(list_->mutex);
  std::vector<std::string> names;
  for (const auto& entry : list_->profiles) names.push_back(entry.first);
  return names;
}

bool FeedbackControllersManager::hasProfile(const std::string& profile) const {
  const ListLock lock(list_->mutex);
  return list_->profiles.count(profile) != 0;
}

std::vector<std::string> FeedbackControllersManager::getUsedRobotStates(bool enabled_only) const {
  const ListLock lock(list_->mutex);
  return namesOf(*list_, enabled_only, [](const Slot& slot) { return slot.robotUses(); });
}

std::vector<std::string> FeedbackControllersManager::getUsedControlStates(bool enabled_only) const {
  const ListLock lock(list_->mutex);
  return namesOf(*list_, enabled_only, [](const Slot& slot) { return slot.controlUses(); });
}

std::vector<std::string> FeedbackControllersManager::getCorrected(const std::string& name) const {
  const ListLock lock(list_->mutex);
  std::vector<std::string> names;
  for (const ResolvedControlUse& use : list_->at(name).slot->controlUses()) {
    if (use.use.modifies) names.push_back(use.name());
  }
  return names;
}

Description FeedbackControllersManager::describe(const std::string& name) const {
  const ListLock lock(list_->mutex);
  return list_->at(name).description;
}

ControllerStatus FeedbackControllersManager::status(const std::string& name) const {
  const ListLock lock(list_->mutex);
  return list_->at(name).status();
}

std::vector<ControllerStatus> FeedbackControllersManager::statusAll() const {
  const ListLock lock(list_->mutex);
  std::vector<ControllerStatus> list;
  for (const std::string& name : list_->order) list.push_back(list_->at(name).status());
  return list;
}

void FeedbackControllersManager::plot(const std::string& name, std::ostream& out) const {
  std::shared_ptr<const Slot> slot;
  {
    const ListLock lock(list_->mutex);
    slot = list_->at(name).slot;
  }
  slot->controller().plot(out);  // code of the controller; it calls ControllerOwner
}

void FeedbackControllersManager::plotAll(std::ostream& out) const {
  for (const std::string& name : getExecutionOrder()) {
    try {
      plot(name, out);
    } catch (const std::invalid_argument&) {  // unloaded in the meantime
    }
  }
}

}  // namespace ctrl_more
