#include "coglab_controllers/ros/feedback_ros.hpp"

#include <sstream>
#include <stdexcept>

#include <ros/console.h>
#include <ros/serialization.h>

namespace coglab_controllers {

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
    : node_(node), manager_(manager), feedback_(manager.feedback()) {
  status_ = node_.advertise<coglab_msgs::FeedbackStatus>("status", 5, true);
  const auto serve = [this](const std::string& name, auto method) {
    services_.push_back(node_.advertiseService(name, method, this));
  };
  serve("enable", &FeedbackRos::onSelect<What::Enable>);
  serve("disable", &FeedbackRos::onSelect<What::Disable>);
  serve("pause", &FeedbackRos::onSelect<What::Pause>);
  serve("resume", &FeedbackRos::onSelect<What::Resume>);
  serve("disable_by_signal", &FeedbackRos::onSignal<What::Disable>);
  serve("pause_by_signal", &FeedbackRos::onSignal<What::Pause>);
  serve("resume_by_signal", &FeedbackRos::onSignal<What::Resume>);
  serve("apply_profile", &FeedbackRos::onProfile);
  serve("set_execution_order", &FeedbackRos::onOrder);
  serve("reload_gains", &FeedbackRos::onReload);
  serve("describe", &FeedbackRos::onDescribe);
}

FeedbackRos::~FeedbackRos() {
  for (ros::ServiceServer& service : services_) service.shutdown();
}

template <typename Response>
bool FeedbackRos::finish(const ctrl_more::Status& status, Response& response) {
  response.success = status.ok();
  response.message = status.message();
  if (status.ok() && status.generation() != 0 &&
      !feedback_.waitAdopted(status.generation(), manager_.planTimeout())) {
    response.message +=
        "the control cycle has not taken the change yet; it will with its next cycle";
  }
  return true;
}

template <FeedbackRos::What what>
bool FeedbackRos::onSelect(Select::Request& request, Select::Response& response) {
  const auto lock = manager_.lockRequests();
  const std::string reason = request.reason.empty() ? "user" : request.reason;
  ctrl_more::Change change;
  for (const std::string& name : request.names) {
    switch (what) {
      case What::Enable:
        change.enable(name);
        break;
      case What::Disable:
        change.disable(name);
        break;
      case What::Pause:
        change.pause(name, reason);
        break;
      case What::Resume:
        change.resume(name, reason);
        break;
    }
  }
  if (!request.names.empty()) return finish(feedback_.apply(change), response);
  switch (what) {
    case What::Enable:
      return finish(feedback_.enable(), response);
    case What::Disable:
      return finish(feedback_.disable(), response);
    case What::Pause:
      return finish(feedback_.pause(), response);
    case What::Resume:
      return finish(feedback_.resume(), response);
  }
  return true;
}

template <FeedbackRos::What what>
bool FeedbackRos::onSignal(BySignal::Request& request, BySignal::Response& response) {
  const auto lock = manager_.lockRequests();
  const auto before = feedback_.statusAll();
  const std::string& signal = request.signal;
  ctrl_more::Status status;
  if (what == What::Disable) {
    status = request.is_control_state ? feedback_.disableAllUsingControlState(signal)
                                      : feedback_.disableAllUsingRobotState(signal);
  } else if (what == What::Pause) {
    status = request.is_control_state ? feedback_.pauseAllUsingControlState(signal)
                                      : feedback_.pauseAllUsingRobotState(signal);
  } else {
    status = request.is_control_state ? feedback_.resumeAllUsingControlState(signal)
                                      : feedback_.resumeAllUsingRobotState(signal);
  }
  for (const ctrl_more::ControllerStatus& was : before) {
    const ctrl_more::ControllerStatus is = feedback_.status(was.name);
    if (is.enabled != was.enabled || is.reasons != was.reasons) {
      response.affected.push_back(was.name);
    }
  }
  return finish(status, response);
}

bool FeedbackRos::onProfile(Select::Request& request, Select::Response& response) {
  if (request.names.size() != 1) {
    response.success = false;
    response.message = "names: expected one profile, got " + std::to_string(request.names.size());
    return true;
  }
  const Answer answer = manager_.applyProfile(request.names[0]);
  response.success = answer.success;
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
  const auto lock = manager_.lockRequests();
  return finish(request.filename.empty() ? feedback_.reloadGains(request.name)
                                         : feedback_.loadGains(request.name, request.filename),
                response);
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
    response.success = false;
  }
  return true;
}

void FeedbackRos::publishStatus() {
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
    entry.fault = controller.fault_text;
    entry.faults = controller.faults;
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
