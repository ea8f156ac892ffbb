#include "coglab_controllers/ros/cancel_ros.hpp"

#include <ros/console.h>

#include "coglab_msgs/ReasonCode.h"

namespace coglab_controllers {

namespace {

using Code = coglab_msgs::ReasonCode;

constexpr bool same(ReasonCode ours, std::uint16_t theirs) {
  return static_cast<std::uint16_t>(ours) == theirs;
}

// The core is independent of ROS and has its own copy of the numbers of the message.
static_assert(same(ReasonCode::None, Code::NONE));
static_assert(same(ReasonCode::InvalidArgument, Code::INVALID_ARGUMENT));
static_assert(same(ReasonCode::OutOfRange, Code::OUT_OF_RANGE));
static_assert(same(ReasonCode::UnknownName, Code::UNKNOWN_NAME));
static_assert(same(ReasonCode::Busy, Code::BUSY));
static_assert(same(ReasonCode::QueueFull, Code::QUEUE_FULL));
static_assert(same(ReasonCode::NotActive, Code::NOT_ACTIVE));
static_assert(same(ReasonCode::NotAdopted, Code::NOT_ADOPTED));
static_assert(same(ReasonCode::TooLate, Code::TOO_LATE));
static_assert(same(ReasonCode::NothingRuns, Code::NOTHING_RUNS));
static_assert(same(ReasonCode::BadFile, Code::BAD_FILE));
static_assert(same(ReasonCode::NotSupported, Code::NOT_SUPPORTED));
static_assert(same(ReasonCode::RobotDisconnected, Code::ROBOT_DISCONNECTED));
static_assert(same(ReasonCode::NotInCommandMode, Code::NOT_IN_COMMAND_MODE));
static_assert(same(ReasonCode::NoPower, Code::NO_POWER));
static_assert(same(ReasonCode::NotStarted, Code::NOT_STARTED));
static_assert(same(ReasonCode::Held, Code::HELD));
static_assert(same(ReasonCode::Stopping, Code::STOPPING));
static_assert(same(ReasonCode::Leashed, Code::LEASHED));
static_assert(same(ReasonCode::PoorQuality, Code::POOR_QUALITY));
static_assert(same(ReasonCode::DriveError, Code::DRIVE_ERROR));
static_assert(same(ReasonCode::StaleJointState, Code::STALE_JOINT_STATE));
static_assert(same(ReasonCode::ComputerLate, Code::COMPUTER_LATE));
static_assert(same(ReasonCode::SecondSender, Code::SECOND_SENDER));
static_assert(same(ReasonCode::DriveWarning, Code::DRIVE_WARNING));
static_assert(same(ReasonCode::CommandsRefused, Code::COMMANDS_REFUSED));
static_assert(same(ReasonCode::NoRealTime, Code::NO_REAL_TIME));
static_assert(same(ReasonCode::GoalMissing, Code::GOAL_MISSING));
static_assert(same(ReasonCode::GoalStale, Code::GOAL_STALE));
static_assert(same(ReasonCode::GoalFromFuture, Code::GOAL_FROM_FUTURE));
static_assert(same(ReasonCode::GoalJumped, Code::GOAL_JUMPED));
static_assert(same(ReasonCode::GoalLost, Code::GOAL_LOST));
static_assert(same(ReasonCode::GoalOutsideWorkspace, Code::GOAL_OUTSIDE_WORKSPACE));
static_assert(same(ReasonCode::GoalUnreachable, Code::GOAL_UNREACHABLE));
static_assert(same(ReasonCode::GoalLeftRegion, Code::GOAL_LEFT_REGION));
static_assert(same(ReasonCode::GoalWithdrawn, Code::GOAL_WITHDRAWN));
static_assert(same(ReasonCode::GoalFell, Code::GOAL_FELL));
static_assert(same(ReasonCode::Cancelled, Code::CANCELLED));
static_assert(same(ReasonCode::Switched, Code::SWITCHED));
static_assert(same(ReasonCode::Superseded, Code::SUPERSEDED));
static_assert(same(ReasonCode::JointBlocked, Code::JOINT_BLOCKED));
static_assert(same(ReasonCode::WorkspaceBorder, Code::WORKSPACE_BORDER));
static_assert(same(ReasonCode::TargetNotReached, Code::TARGET_NOT_REACHED));
static_assert(same(ReasonCode::ControllerFault, Code::CONTROLLER_FAULT));
static_assert(same(ReasonCode::CycleStalled, Code::CYCLE_STALLED));
static_assert(same(ReasonCode::TimeLimit, Code::TIME_LIMIT));
static_assert(same(ReasonCode::WaitsForPerson, Code::WAITS_FOR_PERSON));

}  // namespace

CancelRos::CancelRos(const ros::NodeHandle& node, ControllerManager& manager)
    : node_(node), manager_(manager), spinner_(2, &queue_) {
  node_.setCallbackQueue(&queue_);
  spinner_.start();
}

CancelRos::~CancelRos() {
  manager_.endWaits();
  for (auto& entry : services_) entry.second.shutdown();
  spinner_.stop();
}

void CancelRos::serve(const std::string& id) {
  using Cancel = coglab_msgs::CancelMotion;
  const boost::function<bool(Cancel::Request&, Cancel::Response&)> answer =
      [this, id](Cancel::Request& request, Cancel::Response& response) {
        const CancelAnswer done = manager_.cancel(id, request.time_limit, request.reason);
        response.success = done.success;
        response.was_running = done.was_running;
        response.reason_code = done.number();
        response.message = done.message;
        if (!done.success) ROS_WARN("%s/cancel: %s", id.c_str(), done.message.c_str());
        return true;
      };
  const std::lock_guard<std::mutex> lock(services_mutex_);
  services_[id] = node_.advertiseService(id + "/cancel", answer);
}

void CancelRos::withdraw(const std::string& id) {
  ros::ServiceServer service;
  {
    const std::lock_guard<std::mutex> lock(services_mutex_);
    const auto found = services_.find(id);
    if (found == services_.end()) return;
    service = found->second;
    services_.erase(found);
  }
  service.shutdown();
}

}  // namespace coglab_controllers
