#include "ctrl_more/feedback_controller.hpp"

#include <algorithm>

#include "controller_config.hpp"
#include "ctrl_more/config_node.hpp"
#include "ctrl_more/documentation.hpp"

namespace ctrl_more {
namespace {

bool matches(const std::string& asked, const std::string& map, const std::string& key) {
  return asked == key || asked == map + "/" + key;
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
  out << plotText(*this);
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
  if (initialized_) {
    return Status::failure("'" + name + "' comes too late: signals are declared before a " +
                           "controller is initialized");
  }
  using C = ControlContainer;
  const std::vector<std::pair<std::string, C>> well_known = {
      {"com", C::CentreOfMass},          {"comVelocity", C::CentreOfMass},
      {"comAcceleration", C::CentreOfMass}, {"linearMomentum", C::LinearMomentum},
      {"angularMomentum", C::AngularMomentum}, {"zmp", C::Zmp},
      {"pelvis", C::PelvisOrientation},  {"Position", C::JointSpaceReference},
      {"Velocity", C::JointSpaceReference}, {"Torque", C::JointSpaceReference}};
  ControlSignalUse use;
  use.modifies = true;
  bool found = false;
  const std::size_t slash = name.find('/');
  std::vector<std::string> known;
  for (const auto& entry : well_known) known.push_back(entry.first);
  if (slash == std::string::npos) {
    for (const auto& entry : well_known) {
      if (entry.first != name) continue;
      use.container = entry.second;
      use.role = name;
      found = true;
    }
  } else {
    for (int i = 0; i <= static_cast<int>(C::PelvisOrientation); ++i) {
      if (name.substr(0, slash) != nameOf(static_cast<C>(i))) continue;
      use.container = static_cast<C>(i);
      use.role = name.substr(slash + 1);
      found = !use.role.empty();
    }
  }
  if (!found) {
    return Status::failure("'" + name + "' is no control state: name a well-known signal, or " +
                           "write container/key" + suggestion(name, known));
  }
  use.text = "declared with addUsedControlState()";
  added_control_.push_back(use);
  return {};
}

Status FeedbackController::addUsedRobotState(const std::string& name) {
  if (initialized_) {
    return Status::failure("'" + name + "' comes too late: signals are declared before a " +
                           "controller is initialized");
  }
  if (name.empty()) return Status::failure("a robot state needs a name that is not empty");
  RobotSignalUse use;
  use.role = name;
  for (const RobotSource source : {RobotSource::Measured, RobotSource::Estimated}) {
    const std::string prefix = std::string(nameOf(source)) + "/";
    if (name.compare(0, prefix.size(), prefix) != 0) continue;
    use.source = source;
    use.role = name.substr(prefix.size());
  }
  use.text = "declared with addUsedRobotState()";
  added_robot_.push_back(use);
  return {};
}

bool FeedbackController::isUsingRobotState(const std::string& name) const {
  const auto uses = getUsedRobotStates();
  return std::any_of(uses.begin(), uses.end(), [&](const ResolvedRobotUse& use) {
    return matches(name, nameOf(use.use.source), use.key);
  });
}

bool FeedbackController::isUsingControlState(const std::string& name) const {
  const auto uses = getUsedControlState();
  return std::any_of(uses.begin(), uses.end(), [&](const ResolvedControlUse& use) {
    return matches(name, nameOf(use.use.container), use.key);
  });
}

std::vector<ResolvedControlUse> FeedbackController::getUsedControlState() const {
  if (initialized_) return control_uses_;
  std::vector<ResolvedControlUse> uses;
  for (const ControlSignalUse& use : declaration().control_signals) {
    uses.push_back({use, use.role, {}});
  }
  return uses;
}

std::vector<ResolvedRobotUse> FeedbackController::getUsedRobotStates() const {
  if (initialized_) return robot_uses_;
  std::vector<ResolvedRobotUse> uses;
  for (const RobotSignalUse& use : declaration().robot_signals) uses.push_back({use, use.role, {}});
  return uses;
}

std::map<std::string, std::vector<double>> FeedbackController::getGains() const {
  if (owner_) return owner_->gainsOf(name_).all();
  if (gains_.specs().empty()) return GainValues(describe().gains).all();
  return gains_.all();
}

Status FeedbackController::enable() {
  if (owner_) return owner_->setEnabled(name_, true);
  alone_enabled_ = true;
  return {};
}

Status FeedbackController::disable() {
  if (owner_) return owner_->setEnabled(name_, false);
  alone_enabled_ = false;
  return {};
}

Status FeedbackController::pause() {
  if (owner_) return owner_->setPaused(name_, true);
  alone_paused_ = true;
  return {};
}

Status FeedbackController::resume() {
  if (owner_) return owner_->setPaused(name_, false);
  alone_paused_ = false;
  return {};
}

bool FeedbackController::isEnabled() const {
  return owner_ ? owner_->enabled(name_) : alone_enabled_;
}

bool FeedbackController::isPaused() const { return owner_ ? owner_->paused(name_) : alone_paused_; }

Status FeedbackController::loadGains(const std::string& file) {
  try {
    const ControllerConfig config = readControllerConfig(describe(), ConfigNode::fromFile(file));
    if (owner_) return owner_->replaceGains(name_, config.gains);
    gains_ = config.gains;
    return {};
  } catch (const std::exception& e) {
    return Status::failure(e.what());
  }
}

Status FeedbackController::setGains(const std::map<std::string, std::vector<double>>& gains) {
  GainValues values = owner_ ? owner_->gainsOf(name_)
                             : (gains_.specs().empty() ? GainValues(describe().gains) : gains_);
  for (const auto& entry : gains) {
    const Status status = values.set(entry.first, entry.second);
    if (!status) return status;
  }
  if (owner_) return owner_->replaceGains(name_, values);
  gains_ = values;
  return {};
}

}  // namespace ctrl_more
