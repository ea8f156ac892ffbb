// What the manager does for requests of motions: whether one is welcome, and how one is cancelled.
#include <algorithm>
#include <chrono>
#include <thread>

#include "coglab_controllers/manager/controller_manager.hpp"

namespace coglab_controllers {

namespace {
constexpr double kCancelTime = 2.0, kLongestCancelTime = 10.0;  // s
constexpr auto kCancelPoll = std::chrono::milliseconds(1);
}  // namespace

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
                                                            controller_id + "' to start it afresh");
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
                               "; see lwr/state, then use lwr/command (reset, start)");
  }
  return {};
}

MotionRequest ControllerManager::beginRequest(const std::string& controller_id) {
  MotionRequest request;
  {
    const std::lock_guard<std::mutex> lock(table_);
    if (const LoadedMotion* motion = find(controller_id)) {
      // Before the wait for the lock: a cancel that comes meanwhile makes this request void.
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
  // Asked before the report is read, which is then that of the cycle before the one that served it,
  // or newer: if the arm stands by that, it stands.
  const bool served = order.cancel->served(order.number);
  const CycleReport now = report();
  const bool active = order.id == now.active.c_str();
  // The cycle that was under way when the cancel came may not have seen it.
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

}  // namespace coglab_controllers
