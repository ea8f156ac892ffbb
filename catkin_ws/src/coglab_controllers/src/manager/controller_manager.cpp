#include "coglab_controllers/manager/controller_manager.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "ctrl_more/loading/search_path.hpp"

namespace coglab_controllers {

namespace {

constexpr double kCancelTime = 2.0, kLongestCancelTime = 10.0;  // s
constexpr auto kCancelPoll = std::chrono::milliseconds(1);

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "none" : text;
}

bool validId(const std::string& id) {
  if (id.empty() || id.size() > 48) return false;
  if (std::isalpha(static_cast<unsigned char>(id[0])) == 0) return false;
  return std::all_of(id.begin(), id.end(), [](unsigned char letter) {
    return std::isalnum(letter) != 0 || letter == '_';
  });
}

/// Path of the file of signals named in a file of controllers or managers; empty: none. Errors in
/// that file are reported when it is loaded.
std::string signalsOf(const std::string& user, const ctrl_more::SearchPath& files) {
  std::string path;
  std::optional<ctrl_more::ConfigNode> file;
  try {
    path = files.find(user);
    file = ctrl_more::ConfigNode::fromFile(path);
  } catch (const std::exception&) {
    return "";
  }
  const ctrl_more::ConfigNode* const signals = file->find("signals");
  if (signals == nullptr) return "";
  return ctrl_more::SearchPath(std::filesystem::path(path).parent_path().string())
      .find(signals->text("signals"));
}

}  // namespace

ManagerSettings readManagerSettings(const YAML::Node& node, const std::string& urdf,
                                    const coglab_rt::JointLimits& table, bool lockstep) {
  const Parameters parameters(node, "controller_manager");
  ManagerSettings settings;
  settings.parameters = node;
  settings.lockstep = lockstep;
  settings.robot = makeRobotSetup(urdf, table, parameters);
  CycleSettings& cycle = settings.cycle;
  cycle.cycle_time = parameters.number("cycle_time", cycle.cycle_time, 0.0005, 0.1);
  cycle.sample_timeout = parameters.number("sample_timeout", cycle.sample_timeout, 0.005, 5.0);
  cycle.silent_time = parameters.number("silent_time", cycle.silent_time, 0.01, 10.0);
  cycle.blocked_time = parameters.number("blocked_time", cycle.blocked_time, 0.05, 10.0);
  cycle.overrun_time =
      lockstep ? 0.0 : parameters.number("overrun_time", cycle.cycle_time, 0.0, 10.0);
  settings.plan_timeout = parameters.number("plan_timeout", settings.plan_timeout, 0.05, 30.0);
  settings.types = {{"coglab/DmpController", "libcoglab_dmp_controller.so"},
                    {"coglab/PtpController", "libcoglab_ptp_controller.so"},
                    {"coglab/RemoteMotion", "libcoglab_remote_motion.so"}};
  const Parameters types = parameters.block("types");
  if (types.node().IsDefined() && types.node().IsMap()) {
    for (const auto& entry : types.node()) {
      const std::string package = entry.first.as<std::string>();
      if (entry.second.IsScalar()) {
        settings.types[package] = entry.second.as<std::string>();
      } else {  // a ROS parameter with a slash in its name is a block
        for (const auto& inner : entry.second) {
          settings.types[package + "/" + inner.first.as<std::string>()] =
              inner.second.as<std::string>();
        }
      }
    }
  }
  settings.plugin_paths = parameters.texts("plugin_paths");
  settings.feedback_file = parameters.text("feedback_file", "");
  settings.central_file = parameters.text("central_file", "");
  settings.signals_file = parameters.text("signals_file", "");
  return settings;
}

ControllerManager::ControllerManager(ManagerSettings settings)
    : settings_(std::move(settings)),
      feedback_(*settings_.robot, settings_.cycle.cycle_time, settings_.lockstep, settings_.logger),
      cycle_(settings_.robot, feedback_, settings_.cycle) {
  if (std::function<void()> wait = cycleWait()) cycle_.plans().setWait(wait);
  const Parameters parameters(settings_.parameters, "controller_manager");
  cycle_.setSpeedScale(parameters.number("speed_scale", 1.0, 0.0, 1.0));
  const std::size_t own_rows = feedback_.signals().rows().size();
  loadSignals();
  loadManagers();
  checkOutputs(own_rows);
  cycle_.idle(now_ns());  // freezes the stores here, because this allocates, and not in the first
                          // real cycle
  if (!outputs_.empty()) feedback_.recordReferences();
}

void ControllerManager::loadManagers() {
  const auto report = [this](const std::vector<std::string>& errors) {
    feedback_errors_.insert(feedback_errors_.end(), errors.begin(), errors.end());
  };
  if (!settings_.central_file.empty()) {
    try {
      feedback_.loadCentral(
          ctrl_more::SearchPath("", settings_.plugin_paths).find(settings_.central_file),
          settings_.plugin_paths);
      report(feedback_.central().loadErrors());
    } catch (const std::exception& error) {
      report({std::string("only feedback controllers run, no other manager: ") + error.what()});
    }
  }
  // The list of the central module's file has priority.
  if (settings_.feedback_file.empty() || !feedback_.central().feedbackList().empty()) return;
  report(feedback_.manager().load(settings_.feedback_file).errors);
}

void ControllerManager::loadSignals() {
  try {
    const ctrl_more::SearchPath files("", settings_.plugin_paths);
    SignalFile all;
    const auto read = [&all](const std::string& path) {
      const SignalFile file = readSignalFile(path);
      all.in.insert(all.in.end(), file.in.begin(), file.in.end());
      all.out.insert(all.out.end(), file.out.begin(), file.out.end());
    };
    if (!settings_.signals_file.empty()) read(files.find(settings_.signals_file));
    // The files of controllers and managers may name the signals that they need.
    for (const std::string& user : {settings_.feedback_file, settings_.central_file}) {
      const std::string path = user.empty() ? "" : signalsOf(user, files);
      if (!path.empty()) read(path);
    }
    SignalFile checked = all;
    const auto& own = feedback_.signals().rows();
    checked.in.insert(checked.in.begin(), own.begin(), own.end());
    checkSignals(checked, settings_.topics);
    const ctrl_more::Status added = feedback_.addSignals(all.in);
    if (!added) throw std::runtime_error(added.message());
    outputs_ = all.out;
  } catch (const std::exception& error) {
    feedback_errors_.push_back(std::string("no signals from topics: ") + error.what());
  }
}

void ControllerManager::checkOutputs(std::size_t own_rows) {
  try {
    for (const SignalOutput& row : outputs_) checkOutput(row);
  } catch (const std::exception& error) {
    outputs_.clear();
    feedback_.signals().keepFirst(own_rows);
    feedback_errors_.push_back(std::string("no signals from topics: ") + error.what());
  }
}

/// Refuses an output of an unknown controller, state or reference.
void ControllerManager::checkOutput(const SignalOutput& row) {
  const ctrl_more::FeedbackControllersManager& feedback = feedback_.manager();
  const auto require = [&row](const std::string& what, const std::string& name,
                              const std::vector<std::string>& known) {
    if (std::count(known.begin(), known.end(), name) != 0) return;
    throw ctrl_more::ConfigError(row.place + ": there is no " + what + " '" + name +
                                 "'; there is: " + joined(known));
  };
  if (row.kind != SignalOutput::Kind::Reference) {
    require("feedback controller", row.controller, feedback.getControllersNames());
  }
  if (row.kind == SignalOutput::Kind::State) {
    std::vector<std::string> states;
    for (const auto& state : feedback.describe(row.controller).states) states.push_back(state.name);
    if (states.empty()) {
      throw ctrl_more::ConfigError(row.place + ": controller '" + row.controller +
                                   "' has no states");
    }
    if (!row.key.empty()) require("state of '" + row.controller + "'", row.key, states);
    return;
  }
  const std::string name = std::string(ctrl_more::nameOf(row.container)) + "/" + row.key;
  if (row.kind == SignalOutput::Kind::Correction) {
    require("correction by '" + row.controller + "' of", name,
            feedback.getCorrected(row.controller));
    return;
  }
  const ctrl_more::ControlStates& references = feedback_.references().states;
  std::vector<std::string> known;
  for (int i = 0; i < ctrl_more::kControlContainers; ++i) {
    const auto container = static_cast<ctrl_more::ControlContainer>(i);
    for (const ctrl_more::SignalInfo& info : references.signals(container)) {
      known.push_back(std::string(ctrl_more::nameOf(container)) + "/" + info.key);
    }
  }
  require("reference", name, known);
  const int size = references.find(row.container, row.key).size();
  if (row.type == SignalOutput::Type::Joints && size != kMaxJoints) {
    throw ctrl_more::ConfigError(row.place + ": " + name + " has " + std::to_string(size) +
                                 " numbers, a sensor_msgs/JointState of this arm has " +
                                 std::to_string(kMaxJoints) + "; use std_msgs/Float64MultiArray");
  }
}

ControllerManager::~ControllerManager() = default;

std::int64_t ControllerManager::now_ns() const {
  if (settings_.clock) return settings_.clock();
  return steadyNow();
}

std::function<void()> ControllerManager::cycleWait() const {
  if (!settings_.lockstep) return {};
  // In lockstep no other thread runs the cycle, so the caller's thread adopts between two cycles.
  ControllerManager* const self = const_cast<ControllerManager*>(this);
  return [self] { self->cycle_.idle(self->now_ns()); };
}

LoadedMotion* ControllerManager::find(const std::string& id) const {
  for (const auto& motion : motions_) {
    if (motion->id == id) return motion.get();
  }
  return nullptr;
}

std::string ControllerManager::loadedMotions() const {
  std::vector<std::string> ids;
  for (const auto& motion : motions_) ids.push_back(motion->id);
  return joined(ids);
}

// Other requests do not wait for it, because code of a plug-in and the ROS master may take seconds.
Answer ControllerManager::load(const std::string& id, const std::string& type,
                               const Attach& attach) {
  std::shared_ptr<void> claimed;
  if (const Answer refused = claimNew(id, claimed); !refused.success) return refused;
  const bool motion = !libraryOf(type).empty() || MotionTypes::instance().find(type).controller;
  return motion ? loadMotion(id, type, attach) : loadFeedback(id, type);
}

Answer ControllerManager::load(const std::string& id, const std::string& type,
                               std::unique_ptr<MotionController> controller) {
  std::shared_ptr<void> claimed;
  if (const Answer refused = claimNew(id, claimed); !refused.success) return refused;
  auto loaded = std::make_shared<LoadedMotion>();
  loaded->id = id;
  loaded->type = type;
  loaded->controller = std::move(controller);
  try {
    add(loaded, {});
    return {};
  } catch (const std::exception& error) {
    return Answer::invalid("controller '" + id + "' of type '" + type +
                           "' was not loaded: " + error.what());
  }
}

Answer ControllerManager::claimNew(const std::string& id, std::shared_ptr<void>& claimed) {
  if (!validId(id)) {
    return Answer::invalid("controller_id '" + id +
                           "': expected up to 48 letters, digits and '_', beginning with a "
                           "letter");
  }
  claimed = claim(id);
  if (claimed) return {};
  return Answer::refusal(
      ReasonCode::InvalidArgument,
      "controller_id '" + id + "' is in use; choose another id, or go on with the loaded one");
}

void ControllerManager::add(std::shared_ptr<LoadedMotion> loaded,
                            const std::function<void(MotionController&)>& attach) {
  MotionSetup setup;
  setup.id = loaded->id;
  setup.cycle_time = settings_.cycle.cycle_time;
  setup.parameters =
      Parameters(settings_.parameters, "controller_manager").block(loaded->id).node();
  setup.robot = settings_.robot;
  setup.host = this;
  loaded->controller->configure(setup);
  if (attach) attach(*loaded->controller);
  const std::lock_guard<std::mutex> lock(table_);
  motions_.push_back(std::move(loaded));
}

std::shared_ptr<void> ControllerManager::claim(const std::string& id) {
  {
    const std::lock_guard<std::mutex> lock(table_);
    if (find(id) != nullptr || feedback_.manager().has(id) || !loading_.insert(id).second)
      return {};
  }
  return {this, [this, id](void*) {
            const std::lock_guard<std::mutex> lock(table_);
            loading_.erase(id);
          }};
}

/// The library of a type from the parameter `types`, else an existing lib<package>.so for a type
/// <package>/<class>; empty: none.
std::string ControllerManager::libraryOf(const std::string& type) const {
  const auto place = settings_.types.find(type);
  if (place != settings_.types.end()) return place->second;
  const std::size_t slash = type.find('/');
  if (slash == std::string::npos || MotionTypes::instance().find(type).controller != nullptr)
    return "";
  try {
    return ctrl_more::SearchPath("", settings_.plugin_paths)
        .find("lib" + type.substr(0, slash) + ".so");
  } catch (const std::exception&) {
    return "";
  }
}

Answer ControllerManager::loadMotion(const std::string& id, const std::string& type,
                                     const Attach& attach) {
  const std::string what = "controller '" + id + "' of type '" + type + "' was not loaded: ";
  // Outlives the exceptions below, because their types may belong to the library.
  auto loaded = std::make_shared<LoadedMotion>();
  try {
    loaded->id = id;
    loaded->type = type;
    const std::string library = libraryOf(type);
    if (!library.empty()) {
      const ctrl_more::SearchPath files("", settings_.plugin_paths);
      loaded->library =
          ctrl_more::PluginLibrary::open(files.find(library), MotionTypes::instance());
    }
    const MotionMaker maker = MotionTypes::instance().find(type);
    if (maker.controller == nullptr) {
      return Answer::refusal(
          ReasonCode::UnknownName,
          what + (loaded->library ? "library '" + loaded->library->path() + "' has no type '" +
                                        type + "'; it has: " + joined(loaded->library->types())
                                  : "its library has gone"));
    }
    loaded->controller.reset(maker.controller());
    add(loaded, [&](MotionController& controller) {
      if (attach) attach(controller, maker);
    });
    return {};
  } catch (const std::exception& error) {
    return Answer::invalid(what + error.what());
  } catch (...) {
    return Answer::refusal(ReasonCode::ControllerFault,
                           what + "its code threw an exception not derived from std::exception");
  }
}

Answer ControllerManager::loadFeedback(const std::string& id, const std::string& type) {
  std::vector<std::string> types;
  for (const auto& entry : settings_.types) types.push_back(entry.first);
  try {
    ctrl_more::ControllerEntry entry;
    entry.type = type;
    entry.library = ctrl_more::SearchPath("", settings_.plugin_paths).findLibraryOf(type);
    const ctrl_more::Status status = feedback_.manager().loadController(id, entry);
    if (!status.ok()) return Answer::invalid(status.message());
    return {};
  } catch (const std::exception& error) {
    return Answer::refusal(ReasonCode::UnknownName,
                           "controller_type '" + type + "' is unknown; motion controllers: " +
                               joined(types) + "; as a feedback controller: " + error.what());
  }
}

void ControllerManager::list(std::vector<std::string>& ids, std::vector<std::string>& types) const {
  ids.clear();
  types.clear();
  {
    const std::lock_guard<std::mutex> lock(table_);
    for (const auto& motion : motions_) {
      ids.push_back(motion->id);
      types.push_back(motion->type);
    }
  }
  const ctrl_more::FeedbackControllersManager& feedback = feedback_.manager();
  for (const std::string& name : feedback.getControllersNames()) {
    ids.push_back(name);
    types.push_back(feedback.status(name).type);
  }
}

Answer ControllerManager::unload(const std::string& id, const Detach& detach) {
  std::shared_ptr<LoadedMotion> gone;
  {
    const std::lock_guard<std::mutex> requests(requests_);
    if (feedback_.manager().has(id)) {
      const ctrl_more::Status status = feedback_.manager().unload(id);
      if (status.ok()) return {};
      return Answer::refusal(ReasonCode::Busy, status.message());
    }
    const CycleReport now = report();
    const std::lock_guard<std::mutex> lock(table_);
    const auto found = std::find_if(motions_.begin(), motions_.end(),
                                    [&id](const auto& motion) { return motion->id == id; });
    if (found == motions_.end()) {
      return Answer::refusal(
          ReasonCode::UnknownName,
          "controller_id '" + id + "' is not loaded; loaded: " + loadedMotions());
    }
    // Check the requested and the reported one, because a switch may not be in effect yet.
    if (id == active_id_ || id == now.active.c_str()) {
      return Answer::refusal(ReasonCode::Busy,
                             "'" + id +
                                 "' is the active controller; switch_controller to another "
                                 "one, or to '' for none, first");
    }
    gone = *found;
    motions_.erase(found);
    loading_.insert(id);  // the id stays reserved until the controller is destroyed
  }
  // Running requests end first, and they may need the lock.
  if (detach) detach(gone);
  gone.reset();
  const std::lock_guard<std::mutex> lock(table_);
  loading_.erase(id);
  return {};
}

/// Fills the plan for a switch to this controller. Refused if that is not possible; with a note if
/// no switch is needed.
Answer ControllerManager::planSwitch(const std::string& id, CyclePlan& plan, std::string& type) {
  const std::lock_guard<std::mutex> lock(table_);
  type.clear();
  const bool active = id == active_id_ && !report().fault;
  if (id.empty()) return {true, active ? "no controller is active" : ""};
  LoadedMotion* const found = find(id);
  if (found == nullptr) {
    if (feedback_.manager().has(id)) {
      return Answer::refusal(ReasonCode::UnknownName,
                             "'" + id +
                                 "' is a feedback controller: use feedback/enable; motion "
                                 "controllers: " +
                                 loadedMotions());
    }
    return Answer::refusal(ReasonCode::UnknownName,
                           "controller_id '" + id + "' is not loaded; loaded: " + loadedMotions() +
                               "; use load_controller first");
  }
  type = found->type;
  plan.motion = found->controller.get();
  plan.cancel = found->cancel.get();
  plan.id << id.c_str();
  return {true, active ? "'" + id + "' is active already" : ""};
}

Answer ControllerManager::switchTo(const std::string& id, std::string& type) {
  const std::lock_guard<std::mutex> requests(requests_);
  auto plan = std::make_unique<CyclePlan>();
  const Answer planned = planSwitch(id, *plan, type);
  if (!planned.success || !planned.message.empty()) return planned;
  // The profile of the same name is prepared here and begins in the cycle of the switch.
  ctrl_more::FeedbackControllersManager& feedback = feedback_.manager();
  std::string note;
  ctrl_more::Status prepared;
  const bool some_feedback = !feedback.getControllersNames().empty();
  if (some_feedback || feedback.hasProfile(id)) {
    ctrl_more::Change change;
    if (feedback.hasProfile(id)) {
      change.profile(id);
    } else {
      note = "no feedback profile of this name: feedback controllers stay as they are";
    }
    prepared = feedback.prepare(change.motionSwitched());
    if (!prepared.ok()) return Answer::invalid(prepared.message());
  }
  const PlanOutcome outcome = cycle_.plans().offer(std::move(plan), settings_.plan_timeout);
  if (outcome == PlanOutcome::Withdrawn) {
    if (prepared.generation() != 0) feedback.withdraw(prepared.generation());
    return Answer::refusal(ReasonCode::NotAdopted, notAdopted(outcome));
  }
  if (outcome == PlanOutcome::Taken) note = notAdopted(outcome);
  const std::lock_guard<std::mutex> lock(table_);
  active_id_ = id;
  active_type_ = type;
  if (feedback.hasProfile(id)) profile_ = id;
  return {true, note};
}

Answer ControllerManager::applyProfile(const std::string& profile) {
  const std::lock_guard<std::mutex> requests(requests_);
  ctrl_more::FeedbackControllersManager& feedback = feedback_.manager();
  const ctrl_more::Status status = feedback.applyProfile(profile, false);
  if (!status.ok()) return Answer::refusal(ReasonCode::UnknownName, status.message());
  if (settings_.lockstep) {
    cycle_.idle(now_ns());
  } else if (!feedback.waitAdopted(status.generation(), settings_.plan_timeout)) {
    return {true, "the control cycle has not taken the change yet; it will with its next cycle"};
  }
  const std::lock_guard<std::mutex> lock(table_);
  profile_ = profile;
  return {};
}

void ControllerManager::active(std::string& id, std::string& type) const {
  const std::lock_guard<std::mutex> lock(table_);
  id = active_id_;
  type = active_type_;
}

Answer ControllerManager::setSpeedScale(double scale) {
  if (!std::isfinite(scale) || scale < 0.0 || scale > 1.0) {
    return Answer::refusal(
        ReasonCode::OutOfRange,
        "speed_scale " + std::to_string(scale) + ": expected 0 (stand still) to 1 (as planned)");
  }
  cycle_.setSpeedScale(scale);
  return {};
}

MotionController* ControllerManager::motion(const std::string& id) {
  const std::lock_guard<std::mutex> lock(table_);
  const LoadedMotion* const found = find(id);
  return found != nullptr ? found->controller.get() : nullptr;
}

CycleReport ControllerManager::report() const {
  const std::lock_guard<std::mutex> lock(report_mutex_);
  const_cast<ControlCycle&>(cycle_).readReport(report_);
  return report_;
}

std::string ControllerManager::profile() const {
  const std::lock_guard<std::mutex> lock(table_);
  return profile_;
}

std::string ControllerManager::notAdopted(PlanOutcome outcome) const {
  std::string id, type;
  active(id, type);
  const std::string who = cycle_.inPlugin()
                              ? "controller '" + id + "' has not returned from its code"
                              : "the control cycle does not run";
  const std::string limit = std::to_string(settings_.plan_timeout) + " s";
  if (outcome == PlanOutcome::Taken) {
    return "the control cycle took the request but did not confirm it within " + limit + ": " + who;
  }
  return "the control cycle did not take the request within " + limit + ": " + who +
         "; the request was withdrawn and has no effect";
}

// ---- requests for motions and cancels

Answer ControllerManager::motionWelcome(const std::string& controller_id,
                                        const CycleReport& now) const {
  std::string id, type;
  active(id, type);
  if (id != controller_id) {
    return Answer::refusal(ReasonCode::NotActive,
                           "controller '" + controller_id + "' is not active; active is " +
                               (id.empty() ? "none" : "'" + id + "'") +
                               "; call switch_controller with '" + controller_id + "' first");
  }
  if (now.fault) {
    return Answer::refusal(ReasonCode::ControllerFault, "controller '" + controller_id +
                                                            "' is at fault: " + now.reason.str() +
                                                            "; call switch_controller with '" +
                                                            controller_id + "' to restart it");
  }
  if (now.samples == 0) {
    return Answer::refusal(ReasonCode::StaleJointState,
                           "no joint state from the robot yet; start the robot's interface first");
  }
  const double age = 1e-9 * static_cast<double>(now_ns() - now.robot.stamp_ns);
  if (age > settings_.cycle.sample_timeout) {
    return Answer::refusal(
        ReasonCode::StaleJointState,
        "the newest joint state is " + std::to_string(age) +
            " s old; allowed: " + std::to_string(settings_.cycle.sample_timeout) + " s");
  }
  if (now.robot.block != MotionBlock::None) {
    return Answer::refusal(codeOf(now.robot.block),
                           std::string("the robot follows no motion now: ") +
                               coglab_rt::describe(now.robot.block) +
                               coglab_rt::advice(now.robot.block));
  }
  return {};
}

MotionRequest ControllerManager::beginRequest(const std::string& controller_id) {
  MotionRequest request;
  {
    const std::lock_guard<std::mutex> lock(table_);
    if (const LoadedMotion* motion = find(controller_id)) {
      // Before the wait for the lock: a cancel during the wait makes this request void.
      request.stamp.cancels = motion->cancel->newest();
    }
  }
  request.lock = lockRequests();
  const CycleReport now = report();
  request.stamp.motion_epoch = now.robot.motion_epoch;
  request.welcome = motionWelcome(controller_id, now);
  return request;
}

CancelOrder ControllerManager::askCancel(const std::string& id, const std::string& why) {
  CancelOrder order;
  order.id = id;
  order.cycles = report().cycles;
  {
    const std::lock_guard<std::mutex> lock(table_);
    LoadedMotion* const motion = find(id);
    if (motion != nullptr) order.cancel = motion->cancel;
  }
  if (order.cancel == nullptr) return order;
  Reason reason(ReasonCode::Cancelled, "cancelled");
  if (!why.empty()) reason << ": " << why.substr(0, 120).c_str();
  order.number = order.cancel->ask(reason);
  return order;
}

bool ControllerManager::cancelEnded(const CancelOrder& order, CancelAnswer& answer) const {
  answer = CancelAnswer();
  if (order.cancel == nullptr) {
    static_cast<Answer&>(answer) =
        Answer::refusal(ReasonCode::UnknownName, "controller_id '" + order.id + "' is not loaded");
    return true;
  }
  // Read before the report. The report is then at most one cycle older than the cycle that served
  // the cancel, so its state of rest is valid.
  const bool served = order.cancel->served(order.number);
  const CycleReport now = report();
  const bool active = order.id == now.active.c_str();
  // A cycle that was running when the cancel arrived may not have processed it.
  if (active ? !served : now.cycles < order.cycles + 2) return false;
  answer.was_running = order.cancel->endedMotion(order.number);
  if (!answer.was_running) answer.message = "no motion of '" + order.id + "' was running";
  if (!active && (now.state == ManagerState::Running || now.state == ManagerState::Holding)) {
    static_cast<Answer&>(answer) =
        Answer::refusal(ReasonCode::NotActive, answer.message + "; '" + now.active.str() +
                                                   "' moves the arm: cancel its motion");
    return true;
  }
  return now.standing;
}

CancelAnswer ControllerManager::cancelUnfinished(const CancelOrder& order, double waited) const {
  CancelAnswer answer;
  const CycleReport now = report();
  const std::string time = std::to_string(waited) + " s";
  if (order.id == now.active.c_str() && !order.cancel->served(order.number)) {
    static_cast<Answer&>(answer) = Answer::refusal(
        ReasonCode::NotAdopted, "the control cycle has not taken the cancel over within " + time +
                                    "; it ends the motion as soon as it runs again");
    return answer;
  }
  answer.was_running = order.cancel->endedMotion(order.number);
  const bool blind = now.reason.code() == ReasonCode::StaleJointState;
  static_cast<Answer&>(answer) = Answer::refusal(
      blind ? now.reason.code() : ReasonCode::TimeLimit,
      "the motion is ended, but the set-point of the arm did not come to rest within " + time +
          (blind ? ": " + now.reason.str()
                 : "; its largest joint speed is " +
                       std::to_string(now.robot.commanded_velocity.lpNorm<Eigen::Infinity>()) +
                       " rad/s"));
  return answer;
}

CancelAnswer ControllerManager::cancel(const std::string& id, double time_limit,
                                       const std::string& why) {
  const double limit = time_limit > 0.0 ? std::min(time_limit, kLongestCancelTime) : kCancelTime;
  const auto begin = std::chrono::steady_clock::now();
  const CancelOrder order = askCancel(id, why);
  CancelAnswer answer;
  while (!cancelEnded(order, answer)) {
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - begin;
    if (waited.count() > limit || ending_) return cancelUnfinished(order, waited.count());
    std::this_thread::sleep_for(kCancelPoll);
  }
  return answer;
}

// ---- the types of motion controllers

MotionTypes::MotionTypes()
    : PluginTypesOf("motion controller", "COGLAB_REGISTER_MOTION_CONTROLLER", "coglab_controllers",
                    motionAbi()) {}

void MotionTypes::tryOne(const std::string& type) const {
  std::unique_ptr<MotionController>(find(type).controller());
}

MotionTypes& MotionTypes::instance() {
  static MotionTypes types;
  return types;
}

}  // namespace coglab_controllers
