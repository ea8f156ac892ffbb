#include "coglab_controllers/ros/feedback_ros.hpp"

#include <algorithm>
#include <map>
#include <sstream>
#include <stdexcept>

#include <coglab_msgs/ReasonCode.h>
#include <ros/console.h>
#include <ros/serialization.h>

#include "coglab_controllers/manager/feedback_requests.hpp"
#include "ctrl_more/loading/search_path.hpp"

namespace coglab_controllers {
namespace {

using Code = coglab_msgs::ReasonCode;

std::uint16_t codeOf(ctrl_more::Cause cause) {
  switch (cause) {
    case ctrl_more::Cause::None:
      return Code::NONE;
    case ctrl_more::Cause::InvalidArgument:
      return Code::INVALID_ARGUMENT;
    case ctrl_more::Cause::UnknownName:
      return Code::UNKNOWN_NAME;
    case ctrl_more::Cause::Busy:
      return Code::BUSY;
    case ctrl_more::Cause::BadFile:
      return Code::BAD_FILE;
    case ctrl_more::Cause::Fault:
      return Code::CONTROLLER_FAULT;
  }
  return Code::UNEXPECTED;
}

std::uint16_t codeOf(ctrl_more::PauseCause cause) {
  switch (cause) {
    case ctrl_more::PauseCause::User:
      return Code::PAUSED_BY_USER;
    case ctrl_more::PauseCause::Signal:
      return Code::PAUSED_BY_SIGNAL;
    case ctrl_more::PauseCause::Fault:
      return Code::CONTROLLER_FAULT;
  }
  return Code::UNEXPECTED;
}

/// A refusal by this node.
template <typename Response>
bool refuse(Response& response, std::uint16_t code, const std::string& message) {
  response.success = false;
  response.reason_code = code;
  response.message = message;
  return true;
}

bool refuse(coglab_msgs::FeedbackSelect::Response& response, const ctrl_more::Status& status) {
  return refuse(response, codeOf(status.cause()), status.message());
}

}  // namespace

void RosLogSink::write(const ctrl_more::LogRecord& record) {
  const std::string line = record.toLine();
  switch (record.level) {
    case ctrl_more::LogLevel::Debug:
      ROS_DEBUG_STREAM_NAMED("feedback", line);
      break;
    case ctrl_more::LogLevel::Info:
      ROS_INFO_STREAM_NAMED("feedback", line);
      break;
    case ctrl_more::LogLevel::Warning:
      ROS_WARN_STREAM_NAMED("feedback", line);
      break;
    case ctrl_more::LogLevel::Error:
      ROS_ERROR_STREAM_NAMED("feedback", line);
      break;
  }
}

FeedbackRos::FeedbackRos(const ros::NodeHandle& node, ControllerManager& manager)
    : node_(node), manager_(manager), feedback_(manager.feedback()), reconfigure_(node, manager) {
  status_ = node_.advertise<coglab_msgs::FeedbackStatus>("status", 5, true);
  state_ = node_.advertise<coglab_msgs::FeedbackState>("state", 5);
  const auto serve = [this](const std::string& name, auto method) {
    services_.push_back(node_.advertiseService(name, method, this));
  };
  using Kind = ctrl_more::Change::Kind;
  serve("enable", &FeedbackRos::onSelect<Kind::Enable>);
  serve("disable", &FeedbackRos::onSelect<Kind::Disable>);
  serve("pause", &FeedbackRos::onSelect<Kind::Pause>);
  serve("resume", &FeedbackRos::onSelect<Kind::Resume>);
  serve("disable_by_signal", &FeedbackRos::onSignal<Kind::Disable>);
  serve("pause_by_signal", &FeedbackRos::onSignal<Kind::Pause>);
  serve("resume_by_signal", &FeedbackRos::onSignal<Kind::Resume>);
  serve("apply_profile", &FeedbackRos::onProfile);
  serve("set_execution_order", &FeedbackRos::onOrder);
  serve("reload_gains", &FeedbackRos::onReload);
  serve("set_gains", &FeedbackRos::onSetGains);
  serve("load", &FeedbackRos::onLoad);
  serve("unload", &FeedbackRos::onUnload);
  serve("describe", &FeedbackRos::onDescribe);
}

FeedbackRos::~FeedbackRos() {
  for (ros::ServiceServer& service : services_) service.shutdown();
}

template <typename Response>
bool FeedbackRos::finish(const ctrl_more::Status& status, Response& response) {
  response.success = status.ok();
  response.reason_code = codeOf(status.cause());
  response.message = status.message();
  if (status.ok() && status.generation() != 0 &&
      !feedback_.waitAdopted(status.generation(), manager_.planTimeout())) {
    response.reason_code = Code::NOT_ADOPTED;
    response.message +=
        "the control cycle has not taken the change yet; it will with its next cycle";
  }
  return true;
}

template <ctrl_more::Change::Kind kind>
bool FeedbackRos::onSelect(Select::Request& request, Select::Response& response) {
  using Who = ctrl_more::Change::Who;
  const auto lock = manager_.lockRequests();
  const std::string reason = request.reason.empty() ? "user" : request.reason;
  ctrl_more::Status judged = judgeReason(request.reason);
  if (judged) judged = judgeNames(request.names);
  if (judged && kind == ctrl_more::Change::Kind::Resume) {
    judged = judgeResume(feedback_.statusAll(), request.names, reason);
  }
  if (!judged) return refuse(response, judged);
  ctrl_more::Change change;
  for (const std::string& name : request.names) change.add({kind, name, Who::Named, reason});
  // No name: all controllers.
  if (request.names.empty()) change.add({kind, "", Who::Named, reason});
  return finish(feedback_.apply(change), response);
}

template <ctrl_more::Change::Kind kind>
bool FeedbackRos::onSignal(BySignal::Request& request, BySignal::Response& response) {
  using Who = ctrl_more::Change::Who;
  const auto lock = manager_.lockRequests();
  const auto before = feedback_.statusAll();
  const Who who = request.is_control_state ? Who::UsingControlState : Who::UsingRobotState;
  const ctrl_more::Status status =
      feedback_.apply(ctrl_more::Change().bySignal(kind, who, request.signal));
  for (const ctrl_more::ControllerStatus& was : before) {
    const ctrl_more::ControllerStatus is = feedback_.status(was.name);
    if (is.enabled != was.enabled || is.reasons != was.reasons) {
      response.affected.push_back(was.name);
    }
  }
  return finish(status, response);
}

bool FeedbackRos::onProfile(Select::Request& request, Select::Response& response) {
  const ctrl_more::Status judged = judgeReason(request.reason);
  if (!judged) return refuse(response, judged);
  if (request.names.size() != 1) {
    return refuse(response, Code::INVALID_ARGUMENT,
                  "names: expected one profile, got " + std::to_string(request.names.size()));
  }
  const Answer answer = manager_.applyProfile(request.names[0]);
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  return true;
}

bool FeedbackRos::onOrder(coglab_msgs::SetExecutionOrder::Request& request,
                          coglab_msgs::SetExecutionOrder::Response& response) {
  const auto lock = manager_.lockRequests();
  return finish(feedback_.setExecutionOrder(request.names), response);
}

bool FeedbackRos::onReload(coglab_msgs::ReloadGains::Request& request,
                           coglab_msgs::ReloadGains::Response& response) {
  {
    const auto lock = manager_.lockRequests();
    finish(request.filename.empty() ? feedback_.reloadGains(request.name)
                                    : feedback_.loadGains(request.name, request.filename),
           response);
  }
  reconfigure_.refresh();
  return true;
}

bool FeedbackRos::onSetGains(coglab_msgs::SetGains::Request& request,
                             coglab_msgs::SetGains::Response& response) {
  {
    const auto lock = manager_.lockRequests();
    std::map<std::string, std::vector<double>> gains;
    for (const coglab_msgs::FeedbackGain& gain : request.gains) gains[gain.name] = gain.values;
    finish(feedback_.setGains(request.name, gains), response);
  }
  reconfigure_.refresh();
  return true;
}

bool FeedbackRos::onLoad(coglab_msgs::LoadFeedback::Request& request,
                         coglab_msgs::LoadFeedback::Response& response) {
  // Without the lock of requests, because code of a plug-in may take seconds.
  const std::shared_ptr<void> claimed = manager_.claim(request.name);
  if (!claimed) {
    return refuse(response, Code::BUSY,
                  "'" + request.name + "' is in use; choose another name, or unload it first");
  }
  try {
    const ctrl_more::SearchPath files("", manager_.settings().plugin_paths);
    ctrl_more::ControllerEntry entry;
    entry.type = request.type;
    if (!request.library.empty()) {
      entry.library = files.find(request.library);
    } else {
      if (entry.type.empty()) entry.type = request.name;
      entry.library = files.findLibraryOf(entry.type);
    }
    if (!request.filename.empty()) entry.config_file = files.find(request.filename);
    finish(feedback_.loadController(request.name, entry), response);
    reconfigure_.refresh();
    return true;
  } catch (const std::exception& error) {
    return refuse(response, Code::BAD_FILE,
                  "'" + request.name + "' was not loaded: " + error.what());
  }
}

bool FeedbackRos::onUnload(Select::Request& request, Select::Response& response) {
  {
    const auto lock = manager_.lockRequests();
    const ctrl_more::Status judged = judgeReason(request.reason);
    if (!judged) return refuse(response, judged);
    if (request.names.size() != 1) {
      return refuse(response, Code::INVALID_ARGUMENT,
                    "names: expected one controller, got " + std::to_string(request.names.size()));
    }
    finish(feedback_.unload(request.names[0]), response);
  }
  reconfigure_.refresh();
  return true;
}

bool FeedbackRos::onDescribe(coglab_msgs::DescribeController::Request& request,
                             coglab_msgs::DescribeController::Response& response) {
  try {
    std::ostringstream text;
    feedback_.plot(request.name, text);
    response.text = text.str();
    response.success = true;
  } catch (const std::exception& error) {
    response.text = error.what();
    response.reason_code = Code::UNKNOWN_NAME;
    response.success = false;
  } catch (...) {
    response.text =
        "describe() of '" + request.name + "' threw an exception not derived from std::exception";
    response.reason_code = Code::CONTROLLER_FAULT;
    response.success = false;
  }
  return true;
}

void FeedbackRos::publishState() {
  const ctrl_more::CycleRecord record = feedback_.lastCycle();
  coglab_msgs::FeedbackState message;
  message.header.stamp = ros::Time::now();
  message.cycle = record.cycle;
  for (const ctrl_more::ControllerState& state : record.states) {
    coglab_msgs::FeedbackControllerState entry;
    entry.controller = state.controller;
    for (const ctrl_more::StateSpec& spec : feedback_.describe(state.controller).states) {
      entry.names.push_back(spec.name);
      entry.units.push_back(spec.unit);
    }
    entry.values = state.values;
    message.states.push_back(entry);
  }
  for (const ctrl_more::Attribution& change : record.changes) {
    coglab_msgs::FeedbackCorrection entry;
    entry.controller = change.controller;
    entry.signal = change.signal;
    entry.before = change.before;
    entry.after = change.after;
    entry.size = change.size;
    entry.angle = change.angle;
    message.corrections.push_back(entry);
  }
  state_.publish(message);
}

void FeedbackRos::publishStatus() {
  if (state_.getNumSubscribers() > 0) publishState();
  coglab_msgs::FeedbackStatus message;
  message.profile = manager_.profile();
  for (const ctrl_more::ControllerStatus& controller : feedback_.statusAll()) {
    coglab_msgs::FeedbackControllerStatus entry;
    entry.name = controller.name;
    entry.type = controller.type;
    entry.stage = ctrl_more::nameOf(controller.stage);
    entry.enabled = controller.enabled;
    entry.paused = controller.paused;
    entry.activity = ctrl_more::nameOf(controller.activity);
    entry.pause_reasons = controller.reasons;
    for (const ctrl_more::PauseCause cause : controller.causes) {
      entry.pause_codes.push_back(codeOf(cause));
    }
    entry.fault = controller.fault_text;
    if (controller.fault != ctrl_more::FaultKind::None) entry.fault_code = Code::CONTROLLER_FAULT;
    entry.faults = controller.faults;
    entry.overruns = controller.overruns;
    entry.safety = controller.safety;
    entry.waiting_for = controller.waiting_for;
    message.controllers.push_back(entry);
  }
  message.header.stamp = last_.header.stamp;
  if (published_ && message == last_) return;
  message.header.stamp = ros::Time::now();
  last_ = message;
  published_ = true;
  status_.publish(message);
}

}  // namespace coglab_controllers
