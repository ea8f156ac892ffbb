#include "ctrl_more/feedback_controller.hpp"

#include <algorithm>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/description/configuration.hpp"
#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

// Declared uses, before their keys and sizes are known.
template <typename Resolved, typename Uses>
std::vector<Resolved> unresolved(const Uses& declared) {
  std::vector<Resolved> uses;
  for (const auto& use : declared) uses.push_back({{use, use.role}});
  return uses;
}

template <typename Uses>
bool contains(const Uses& uses, const std::string& name) {
  return std::any_of(uses.begin(), uses.end(),
                     [&](const auto& use) { return name == use.key || name == use.name(); });
}

Status tooLate(const std::string& name) {
  return Status::failure("'" + name + "' comes too late: signals are declared before a " +
                         "controller is initialized");
}

}  // namespace

Status FeedbackController::setName(const std::string& name) {
  if (owner_ || initialized_) {
    return Status::failure("controller '" + name_ +
                           "' is loaded; its name comes from the list file");
  }
  if (name.empty()) return Status::failure("a controller needs a name that is not empty");
  name_ = name;
  return {};
}

void FeedbackController::plot(std::ostream& out) const {
  out << plotText({getName(), declaration(), isEnabled(), isPaused(), getUsedRobotStates(),
                   getUsedControlState(), getGains()});
}

Description FeedbackController::declaration() const {
  Description description = describe();
  description.robot_signals.insert(description.robot_signals.end(), added_robot_.begin(),
                                   added_robot_.end());
  description.control_signals.insert(description.control_signals.end(), added_control_.begin(),
                                     added_control_.end());
  return description;
}

Status FeedbackController::addUsedControlState(const std::string& name) {
  if (initialized_) return tooLate(name);
  using C = ControlContainer;
  static const std::map<std::string, C> well_known = {{"com", C::CentreOfMass},
                                                      {"comVelocity", C::CentreOfMass},
                                                      {"comAcceleration", C::CentreOfMass},
                                                      {"linearMomentum", C::LinearMomentum},
                                                      {"angularMomentum", C::AngularMomentum},
                                                      {"zmp", C::Zmp},
                                                      {"pelvis", C::PelvisOrientation},
                                                      {"Position", C::JointSpaceReference},
                                                      {"Velocity", C::JointSpaceReference},
                                                      {"Torque", C::JointSpaceReference}};
  ControlSignalUse use;
  use.modifies = true;
  use.text = "declared with addUsedControlState()";
  const std::size_t slash = name.find('/');
  if (slash == std::string::npos) {
    const auto found = well_known.find(name);
    if (found != well_known.end()) {
      use.container = found->second;
      use.role = name;
    }
  } else {
    for (int i = 0; i < kControlContainers; ++i) {
      if (name.substr(0, slash) != nameOf(static_cast<C>(i))) continue;
      use.container = static_cast<C>(i);
      use.role = name.substr(slash + 1);
    }
  }
  if (use.role.empty()) {
    std::vector<std::string> known;
    for (const auto& entry : well_known) known.push_back(entry.first);
    return Status::failure("'" + name + "' is no control state: name a well-known signal, or " +
                           "write container/key" + suggestion(name, known));
  }
  added_control_.push_back(use);
  return {};
}

Status FeedbackController::addUsedRobotState(const std::string& name) {
  if (initialized_) return tooLate(name);
  if (name.empty()) return Status::failure("a robot state needs a name that is not empty");
  RobotSignalUse use;
  use.role = name;
  use.text = "declared with addUsedRobotState()";
  for (const RobotSource source : {RobotSource::Measured, RobotSource::Estimated}) {
    const std::string prefix = std::string(nameOf(source)) + "/";
    if (name.compare(0, prefix.size(), prefix) != 0) continue;
    use.source = source;
    use.role = name.substr(prefix.size());
  }
  added_robot_.push_back(use);
  return {};
}

bool FeedbackController::isUsingRobotState(const std::string& name) const {
  return contains(getUsedRobotStates(), name);
}

bool FeedbackController::isUsingControlState(const std::string& name) const {
  return contains(getUsedControlState(), name);
}

std::vector<ResolvedControlUse> FeedbackController::getUsedControlState() const {
  return initialized_ ? control_uses_
                      : unresolved<ResolvedControlUse>(declaration().control_signals);
}

std::vector<ResolvedRobotUse> FeedbackController::getUsedRobotStates() const {
  return initialized_ ? robot_uses_ : unresolved<ResolvedRobotUse>(declaration().robot_signals);
}

GainValues FeedbackController::presentGains() const {
  if (ControllerOwner* owner = owner_) return owner->getGains(name_);
  return gains_.specs().empty() ? GainValues(describe().gains) : gains_;
}

std::map<std::string, std::vector<double>> FeedbackController::getGains() const {
  return presentGains().all();
}

Status FeedbackController::enable() {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().enable(name_));
  alone_enabled_ = true;
  return {};
}

Status FeedbackController::disable() {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().disable(name_));
  alone_enabled_ = false;
  return {};
}

Status FeedbackController::pause() {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().pause(name_));
  alone_paused_ = true;
  return {};
}

Status FeedbackController::resume() {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().resume(name_));
  alone_paused_ = false;
  return {};
}

bool FeedbackController::isEnabled() const {
  const ControllerOwner* owner = owner_;
  return owner ? owner->isEnabled(name_) : alone_enabled_;
}

bool FeedbackController::isPaused() const {
  const ControllerOwner* owner = owner_;
  return owner ? owner->isPaused(name_) : alone_paused_;
}

Status FeedbackController::loadGains(const std::string& file) {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().gainFile(name_, file));
  try {
    gains_ = readControllerConfig(describe(), ConfigNode::fromFile(file)).gains;
    return {};
  } catch (const std::exception& e) {
    return Status::failure(e.what());
  }
}

Status FeedbackController::setGains(const std::map<std::string, std::vector<double>>& gains) {
  if (ControllerOwner* owner = owner_) return owner->apply(Change().gains(name_, gains));
  GainValues values = presentGains();
  for (const auto& entry : gains) {
    const Status status = values.set(entry.first, entry.second);
    if (!status) return status;
  }
  gains_ = values;
  return {};
}

FeedbackControllerPrototypes::FeedbackControllerPrototypes()
    : PluginTypesOf("controller", "CTRL_MORE_REGISTER_CONTROLLER", "ctrl_more", thisAbi()) {}

bool FeedbackControllerPrototypes::insert(
    const std::pair<const std::string, FeedbackControllerMaker>& entry, const Abi& abi) {
  return add(entry.first, entry.second, abi);
}

void FeedbackControllerPrototypes::tryOne(const std::string& type) const {
  const std::unique_ptr<FeedbackController> controller(find(type)());
  if (controller) controller->describe();
}

FeedbackControllerPrototypes& prototypes() {
  static FeedbackControllerPrototypes the_map;
  return the_map;
}

}  // namespace ctrl_more
