#include "ctrl_more/central_module.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>
#include <stdexcept>

#include "ctrl_more/loading/search_path.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

const char* const kFeedback = "Feedback";

struct ManagerTypes {
  std::mutex mutex;
  std::map<std::string, CentralModule::ManagerMaker> makers;
};

ManagerTypes& managerTypes() {
  static ManagerTypes types;
  return types;
}

Status copySignals(const RobotStates& from, RobotStates& to) {
  for (const RobotSource source : {RobotSource::Measured, RobotSource::Estimated}) {
    for (const SignalInfo& info : from.signals(source)) {
      const RobotSignal signal = from.find(source, info.key);
      if (from.stamp(signal) == kNeverWritten) continue;
      const Status status =
          source == RobotSource::Measured
              ? to.setMeasuredData(info.key, from.view(signal), from.stamp(signal))
              : to.setEstimatedData(info.key, from.view(signal), from.stamp(signal));
      if (!status) return status;
    }
  }
  return {};
}

std::string libraryAt(const ConfigNode& node, const SearchPath& files) {
  try {
    return files.find(node.text("libPath"));
  } catch (const ConfigError&) {
    throw;
  } catch (const std::exception& e) {
    throw node.error(std::string("libPath: ") + e.what());
  }
}

// Copies all signals of `from`. Adds missing keys to `to`; fails if `to` is frozen.
Status copySignals(const ControlStates& from, ControlStates& to) {
  for (int i = 0; i < kControlContainers; ++i) {
    const auto container = static_cast<ControlContainer>(i);
    for (const SignalInfo& info : from.signals(container)) {
      const Status status =
          to.declare(container, info.key, static_cast<int>(info.size), info.unit, info.frame);
      if (!status) return status;
      to.view(to.find(container, info.key)) = from.view(from.find(container, info.key));
    }
  }
  return {};
}

}  // namespace

ManagerPrototypes::ManagerPrototypes()
    : PluginTypesOf("manager", "CTRL_MORE_REGISTER_MANAGER", "ctrl_more", thisAbi()) {}

bool ManagerPrototypes::insert(const std::string& type, ManagerLibraryMaker maker, const Abi& abi) {
  return add(type, maker, abi);
}

ManagerPrototypes& managerPrototypes() {
  static ManagerPrototypes the_list;
  return the_list;
}

bool CentralModule::registerManager(const std::string& type, ManagerMaker maker) {
  ManagerTypes& types = managerTypes();
  const std::lock_guard<std::mutex> lock(types.mutex);
  if (type == kFeedback || !maker) return false;
  return types.makers.emplace(type, std::move(maker)).second;
}

struct CentralModule::Own {
  RobotStates robot;
  ControlStates control;
};

CentralModule::CentralModule(const std::string& file, Logger* logger)
    : CentralModule(ConfigNode::fromFile(file), std::filesystem::path(file).parent_path().string(),
                    logger) {}

CentralModule::CentralModule(const ConfigNode& config, const std::string& base, Logger* logger)
    : logger_(logger ? logger : &Logger::standard()) {
  build(config, base);
}

CentralModule::CentralModule(const ConfigNode& config, const std::string& base, const Host& host,
                             Logger* logger)
    : logger_(logger ? logger : &Logger::standard()),
      robot_(&host.robot),
      control_(&host.control),
      options_(host.feedback),
      folders_(host.folders) {
  build(config, base);
  if (!feedback_) {
    throw config.error("a robot needs a manager of type Feedback; add one to the list of managers");
  }
}

CentralModule::~CentralModule() = default;
CentralModule::CentralModule(CentralModule&&) noexcept = default;

void CentralModule::build(const ConfigNode& config, const std::string& base) {
  if (config.kind() != ConfigNode::Kind::Map) {
    throw config.error("a central module's file must be a map");
  }
  const ConfigNode* list = config.find("managers");
  if (!list) throw config.error("a central module's file needs managers: [names]");
  const std::vector<std::string> names = list->texts("managers");
  std::vector<std::string> known = names;
  known.insert(known.end(), {"managers", "joints", "period", "signals"});
  config.requireKeys("central module", known);
  makeStores(config);
  for (const std::string& name : names) {
    const ConfigNode* block = config.find(name);
    if (!block || block->kind() != ConfigNode::Kind::Map) {
      throw list->error("managers lists '" + name + "', but there is no block '" + name + ":'" +
                        suggestion(name, config.keys()));
    }
    if (std::count(names.begin(), names.end(), name) > 1) {
      throw list->error("managers lists '" + name + "' twice");
    }
    const ConfigNode* type = block->find("type");
    if (!type) throw block->error("manager '" + name + "' needs a type");
    const ConfigNode* library = block->find("libPath");
    const std::string type_name = type->text("type");
    managers_.push_back(type_name == kFeedback ? makeFeedback(name, *block, base)
                        : library              ? makeFromLibrary(name, *block, type_name,
                                                                 libraryAt(*library, SearchPath(base, folders_)))
                                               : makeOther(name, *block, *type, base));
  }
  for (const std::string& name : names) logs_.emplace_back(logger_, name);
  off_.assign(managers_.size(), false);
}

void CentralModule::makeStores(const ConfigNode& config) {
  int joints = 0;
  double period = 0.005;
  if (const ConfigNode* node = config.find("joints")) {
    const double value = node->number("joints");
    if (value != std::floor(value) || value < 0 || value > 1000) {
      throw node->error("joints expects a whole number from 0 to 1000");
    }
    joints = static_cast<int>(value);
  }
  if (const ConfigNode* node = config.find("period")) {
    period = node->number("period");
    if (!(period > 0.0 && period < 1.0)) throw node->error("period expects 0 to 1 s");
  }
  if (!control_) {
    own_ = std::make_unique<Own>(Own{RobotStates(logger_), ControlStates(joints, period, logger_)});
    robot_ = &own_->robot;
    control_ = &own_->control;
    return;
  }
  const ConfigNode* const given = config.find("joints");
  if (given && joints != control_->joints()) {
    throw given->error("this robot has " + std::to_string(control_->joints()) + " joints");
  }
  const ConfigNode* const cycle = config.find("period");
  if (cycle && std::abs(period - control_->controlPeriod()) > 1e-9) {
    throw cycle->error("this robot's period is " + std::to_string(control_->controlPeriod()) +
                       " s");
  }
}

std::unique_ptr<Manager> CentralModule::makeFeedback(const std::string& name,
                                                     const ConfigNode& block,
                                                     const std::string& base) {
  block.requireKeys("manager '" + name + "'",
                    {"type", "listFile", "blend_s", "timed", "check_undeclared"});
  if (feedback_) throw block.error("there is a Feedback manager already");
  ManagerOptions options = options_;
  if (const ConfigNode* node = block.find("blend_s")) {
    options.blend_s = node->number("blend_s");
    if (options.blend_s < 0.0) throw node->error("blend_s must not be negative");
  }
  if (const ConfigNode* node = block.find("timed")) options.timed = node->boolean("timed");
  if (const ConfigNode* node = block.find("check_undeclared")) {
    options.check_undeclared = node->boolean("check_undeclared");
  }
  auto manager = std::make_unique<FeedbackControllersManager>(*robot_, *control_, options, logger_);
  manager->setName(name);
  if (const ConfigNode* node = block.find("listFile")) {
    feedback_list_ = node->text("listFile");
    std::string file;
    try {
      file = SearchPath(base).find(node->text("listFile"));
    } catch (const ConfigError&) {
      throw;
    } catch (const std::exception& e) {
      throw node->error(std::string("listFile: ") + e.what());
    }
    const LoadReport report = manager->load(file);
    load_errors_.insert(load_errors_.end(), report.errors.begin(), report.errors.end());
  }
  feedback_ = manager.get();
  return manager;
}

std::unique_ptr<Manager> CentralModule::makeOther(const std::string& name, const ConfigNode& block,
                                                  const ConfigNode& type, const std::string& base) {
  const std::string type_name = type.text("type");
  ManagerMaker maker;
  std::vector<std::string> types = {kFeedback};
  {
    ManagerTypes& all = managerTypes();
    const std::lock_guard<std::mutex> lock(all.mutex);
    for (const auto& entry : all.makers) types.push_back(entry.first);
    const auto found = all.makers.find(type_name);
    if (found != all.makers.end()) maker = found->second;
  }
  if (!maker) {
    std::string library;
    try {
      library = SearchPath(base, folders_).findLibraryOf(type_name);
    } catch (const std::runtime_error&) {  // then it is no type at all
    }
    if (!library.empty()) return makeFromLibrary(name, block, type_name, library);
    throw type.error("manager '" + name + "' has unknown type '" + type_name + "'" +
                     suggestion(type_name, types));
  }
  auto manager = maker(name, block, *robot_, *control_, logger_);
  if (!manager) throw block.error("the maker of '" + type_name + "' returned nothing");
  return manager;
}

std::unique_ptr<Manager> CentralModule::makeFromLibrary(const std::string& name,
                                                        const ConfigNode& block,
                                                        const std::string& type,
                                                        const std::string& path) {
  std::string complaint;
  try {
    libraries_.push_back(PluginLibrary::open(path, managerPrototypes()));
    const std::vector<std::string>& types = libraries_.back()->types();
    if (std::count(types.begin(), types.end(), type) == 0) {
      throw std::runtime_error("library " + path + " has no manager of type '" + type + "'" +
                               suggestion(type, types));
    }
    auto manager = managerPrototypes().find(type)(name, block, *robot_, *control_, logger_);
    if (manager) return manager;
    complaint = "the maker of '" + type + "' returned nothing";
  } catch (const std::exception& e) {
    // The exception ends here: its code may lie in the library, which is closed if this fails.
    complaint = e.what();
  } catch (...) {
    complaint = "it threw something that is not a std::exception";
  }
  throw block.error("manager '" + name + "': " + complaint);
}

FeedbackControllersManager& CentralModule::feedbackControllers() {
  if (!feedback_) throw std::logic_error("the central module's file lists no Feedback manager");
  return *feedback_;
}

Manager& CentralModule::manager(const std::string& name) {
  for (const auto& manager : managers_) {
    if (manager->name() == name) return *manager;
  }
  throw std::invalid_argument("no manager '" + name + "'" + suggestion(name, managers()));
}

std::vector<std::string> CentralModule::managers() const {
  std::vector<std::string> names;
  for (const auto& manager : managers_) names.push_back(manager->name());
  return names;
}

void CentralModule::update(const Cycle& cycle) noexcept {
  begin(cycle);
  for (const Stage stage : {Stage::Task, Stage::Joint}) run(stage);
  end();
}

void CentralModule::begin(const Cycle& cycle) noexcept {
  number_ = cycle.number;
  for (const auto& manager : managers_) manager->beginCycle(cycle);
  before_.resize(static_cast<std::size_t>(control_->dataSize()));
}

void CentralModule::run(Stage stage) noexcept {
  for (std::size_t i = 0; i < managers_.size(); ++i) {
    if (managers_[i].get() == feedback_) {  // it guards each of its controllers
      managers_[i]->updateStage(stage, *robot_, *control_);
    } else if (!off_[i]) {
      isolate(i, stage);
    }
  }
}

void CentralModule::end() noexcept {
  for (const auto& manager : managers_) manager->endCycle();
}

/// Runs a stage of a manager, and undoes it if a number is not finite.
void CentralModule::isolate(std::size_t manager, Stage stage) noexcept {
  std::copy_n(control_->data(), before_.size(), before_.data());
  managers_[manager]->updateStage(stage, *robot_, *control_);
  const double* const data = control_->data();
  if (std::all_of(data, data + before_.size(), [](double v) { return std::isfinite(v); })) return;
  std::copy(before_.begin(), before_.end(), control_->data());
  off_[manager] = true;
  CTRL_MORE_LOG(logs_[manager], Error,
                "it wrote a number that is not finite: it is off until the next start");
}

void CentralModule::update() noexcept {
  update({robot_->newestStamp(), control_->controlPeriod(), number_ + 1});
}

Status CentralModule::update(const RobotStates& robot, ControlStates* control) {
  if (!control) return Status::failure("update() needs control states, got null");
  Status status = copySignals(robot, *robot_);
  if (status) status = copySignals(*control, *control_);
  if (!status) return status;
  update();
  return copySignals(*control_, *control);
}

void CentralModule::plot(std::ostream& out) const {
  out << "managers:";
  for (const auto& manager : managers_) out << ' ' << manager->name();
  out << '\n';
  robot_->print(out);
  control_->print(out);
  if (feedback_) feedback_->plotAll(out);
}

}  // namespace ctrl_more
