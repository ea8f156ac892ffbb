#include "coglab_controllers/ros/manager_ros.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "coglab_controllers/ros/custom_motion_controller_ros.hpp"
#include "coglab_controllers/ros/ros_parameters.hpp"
#include "coglab_msgs/ControllerStatus.h"
#include "coglab_rt/ros/parameter.hpp"

namespace coglab_controllers {

namespace {
constexpr auto kPublishPeriod = std::chrono::milliseconds(5);
constexpr double kStallTime = 0.25;  // s without a cycle that counts as a stall
constexpr auto kDetachTime = std::chrono::seconds(2);
// s after which the status is published again if only numbers in a sentence have changed. It shows
// that the node is alive.
constexpr double kTellPeriod = 0.25;

/// An exception here would end the process that moves the arm.
template <typename Function>
void guarded(const char* what, const Function& function) {
  try {
    function();
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(1.0, "%s: %s", what, error.what());
  } catch (...) {
    ROS_ERROR_THROTTLE(1.0, "%s: an exception not derived from std::exception", what);
  }
}
}  // namespace

ManagerRos::ManagerRos(const ros::NodeHandle& node, coglab_rt::ArmMailboxes& mailboxes,
                       Options options)
    : node_(node),
      options_(std::move(options)),
      log_sink_(std::make_shared<RosLogSink>()),
      logger_(std::make_unique<ctrl_more::Logger>()) {
  node_.setCallbackQueue(&queue_);
  logger_->addSink(log_sink_);
  logger_->startDraining();
  ManagerSettings settings = readManagerSettings(node_);
  settings.logger = logger_.get();
  settings.topics = topicRules(node_);
  options_.thread.priority =
      coglab_rt::readParameter(node_, "priority", options_.thread.priority, "a whole number");
  if (options_.thread.priority > options_.highest_priority) {
    ROS_WARN(
        "controller_manager: priority %d is kept to %d, below that of the arm's thread "
        "(lwr/rt_priority)",
        options_.thread.priority, options_.highest_priority);
    options_.thread.priority = options_.highest_priority;
  }
  manager_ = std::make_unique<ControllerManager>(std::move(settings));
  for (const std::string& error : manager_->feedbackErrors()) {
    ROS_ERROR("feedback controllers: %s", error.c_str());
  }
  thread_ = std::make_unique<ControlThread>(manager_->cycle(), mailboxes, options_.thread);
  tf_ = std::make_unique<tf2_ros::Buffer>(ros::Duration(10.0));
  tf_listener_ = std::make_unique<TfListener>(*tf_);
  target_message_.name = manager_->settings().robot->chain.jointNames();
  target_message_.velocity.resize(target_message_.name.size());
}

ManagerRos::~ManagerRos() { shutdown(); }

void ManagerRos::start() {
  thread_->start();
  tf_listener_->start();
  status_ = node_.advertise<coglab_msgs::ControllerStatus>("status", 10, true);
  services_.push_back(node_.advertiseService("load_controller", &ManagerRos::onLoad, this));
  services_.push_back(node_.advertiseService("unload_controller", &ManagerRos::onUnload, this));
  services_.push_back(node_.advertiseService("list_controllers", &ManagerRos::onList, this));
  services_.push_back(node_.advertiseService("switch_controller", &ManagerRos::onSwitch, this));
  services_.push_back(node_.advertiseService("get_active_controller", &ManagerRos::onActive, this));
  services_.push_back(node_.advertiseService("speed_scale", &ManagerRos::onSpeed, this));
  speed_ = node_.subscribe("speed_scale", 1, &ManagerRos::onSpeedTopic, this);
  feedback_ = std::make_unique<FeedbackRos>(ros::NodeHandle(node_, "feedback"), *manager_);
  cancel_ = std::make_unique<CancelRos>(node_, *manager_);
  try {
    signals_ = std::make_unique<SignalTopics>(node_, *manager_);
  } catch (const std::exception& error) {
    ROS_ERROR("the robot runs without signals from topics: %s; use other topics", error.what());
  }
  diagnostics_ = std::make_unique<diagnostic_updater::Updater>(node_);
  diagnostics_->setHardwareID("none");
  diagnostics_->add("control cycle", this, &ManagerRos::diagnose);
  loadFromParameters();
  spinner_ = std::make_unique<ros::AsyncSpinner>(4, &queue_);
  spinner_->start();
  goals_ = std::thread([this] { goalLoop(); });
  publisher_ = std::thread([this] { publishLoop(); });
}

void ManagerRos::shutdown() {
  if (stopping_.exchange(true)) return;
  if (goals_.joinable()) goals_.join();
  if (publisher_.joinable()) publisher_.join();
  queue_.disable();
  if (spinner_) spinner_->stop();
  thread_->stop();
  // The rest contacts the ROS master, which may not answer. All threads of this node have ended.
  tf_listener_->stop();
  for (ros::ServiceServer& service : services_) service.shutdown();
  speed_.shutdown();
  feedback_.reset();
  cancel_.reset();
  signals_.reset();
  const std::lock_guard<std::mutex> lock(sides_mutex_);
  sides_.clear();
}

void ManagerRos::loadFromParameters() {
  const Parameters parameters(manager_->settings().parameters, "controller_manager");
  const Parameters list = parameters.block("load");
  if (list.node().IsDefined() && list.node().IsMap()) {
    for (const auto& entry : list.node()) {
      const std::string id = entry.first.as<std::string>();
      const Answer answer = load(id, entry.second.as<std::string>());
      if (!answer.success) ROS_ERROR("%s", answer.message.c_str());
    }
  }
  const std::string active = parameters.text("active", "");
  if (active.empty()) return;
  std::string type;
  const Answer answer = switchTo(active, type);
  if (!answer.success) ROS_ERROR("%s", answer.message.c_str());
}

Answer ManagerRos::load(const std::string& id, const std::string& type) {
  const auto attach = [this, &id](MotionController& controller, const MotionMaker& maker) {
    auto side = std::make_shared<Side>();
    side->id = id;
    if (maker.ros != nullptr) {
      side->ros.reset(maker.ros());
    } else if (dynamic_cast<CustomMotionController*>(&controller) != nullptr) {
      side->ros = std::make_unique<CustomMotionControllerRos>();
    } else {
      return;
    }
    RosContext context;
    context.tf = tf_.get();
    context.listener = tf_listener_.get();
    context.take_arm = [this, id] { return takeArm(id); };
    context.cancel = [this, id](const std::string& why) { manager_->askCancel(id, why); };
    side->ros->attach(controller, ros::NodeHandle(node_, id), context);
    Tunables* const gains = controller.tunables();
    if (gains != nullptr && !gains->all().empty()) {
      side->gains = std::make_unique<ReconfigureServer>(ros::NodeHandle(node_, id), *gains);
    }
    const std::lock_guard<std::mutex> lock(sides_mutex_);
    sides_.push_back(std::move(side));
  };
  const Answer answer = manager_->load(id, type, attach);
  if (!answer.success) return answer;
  if (manager_->motion(id) != nullptr) {
    cancel_->serve(id);
  } else {
    feedback_->refreshGains();
  }
  return answer;
}

/// Ends the services and topics of an unloaded controller.
void ManagerRos::detach(const std::string& id, std::shared_ptr<const LoadedMotion> motion) {
  cancel_->withdraw(id);
  std::shared_ptr<Side> side;
  {
    const std::lock_guard<std::mutex> lock(sides_mutex_);
    const auto found = std::find_if(sides_.begin(), sides_.end(),
                                    [&id](const auto& one) { return one->id == id; });
    if (found == sides_.end()) return;
    side = *found;
    sides_.erase(found);
  }
  side->motion = std::move(motion);
  // The loops may be using it. After the time limit the last user frees it.
  const auto end = std::chrono::steady_clock::now() + kDetachTime;
  while (side.use_count() > 1 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

Answer ManagerRos::switchTo(const std::string& id, std::string& type) {
  const Answer answer = manager_->switchTo(id, type);
  if (answer.success) {
    active_.store(!id.empty(), std::memory_order_relaxed);
    if (options_.controller_active) options_.controller_active(!id.empty());
  }
  return answer;
}

Answer ManagerRos::takeArm(const std::string& id) {
  std::string active, type;
  manager_->active(active, type);
  const CycleReport now = manager_->report();
  const bool moves = now.motion == MotionState::Running || now.motion == MotionState::Holding;
  if (active != id && moves && !now.fault) {
    return Answer::refusal(ReasonCode::Busy, "controller '" + active +
                                                 "' moves the arm; end its motion first (service " +
                                                 active + "/cancel of the controller manager)");
  }
  return switchTo(id, type);
}

bool ManagerRos::onLoad(coglab_msgs::LoadController::Request& request,
                        coglab_msgs::LoadController::Response& response) {
  const Answer answer = load(request.controller_id, request.controller_type);
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  manager_->list(response.controller_ids, response.controller_types);
  if (!answer.success) ROS_WARN("load_controller refused: %s", answer.message.c_str());
  return true;
}

bool ManagerRos::onUnload(coglab_msgs::UnloadController::Request& request,
                          coglab_msgs::UnloadController::Response& response) {
  const std::string& id = request.controller_id;
  const Answer answer = manager_->unload(
      id,
      [this, &id](std::shared_ptr<const LoadedMotion> motion) { detach(id, std::move(motion)); });
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  manager_->list(response.controller_ids, response.controller_types);
  if (answer.success) feedback_->refreshGains();
  if (!answer.success) ROS_WARN("unload_controller refused: %s", answer.message.c_str());
  return true;
}

bool ManagerRos::onList(coglab_msgs::ListControllers::Request&,
                        coglab_msgs::ListControllers::Response& response) {
  manager_->list(response.controller_ids, response.controller_types);
  return true;
}

bool ManagerRos::onSwitch(coglab_msgs::SwitchController::Request& request,
                          coglab_msgs::SwitchController::Response& response) {
  const Answer answer = switchTo(request.controller_id, response.controller_type);
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  if (!answer.success) ROS_WARN("switch_controller refused: %s", answer.message.c_str());
  return true;
}

bool ManagerRos::onActive(coglab_msgs::GetActiveController::Request&,
                          coglab_msgs::GetActiveController::Response& response) {
  manager_->active(response.controller_id, response.controller_type);
  return true;
}

bool ManagerRos::onSpeed(coglab_msgs::SetSpeedScale::Request& request,
                         coglab_msgs::SetSpeedScale::Response& response) {
  const Answer answer = manager_->setSpeedScale(request.speed_scale);
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  return true;
}

void ManagerRos::onSpeedTopic(const std_msgs::Float64& message) {
  const Answer answer = manager_->setSpeedScale(message.data);
  if (!answer.success) ROS_WARN_THROTTLE(1.0, "%s", answer.message.c_str());
}

std::vector<std::shared_ptr<ManagerRos::Side>> ManagerRos::sides() {
  const std::lock_guard<std::mutex> lock(sides_mutex_);
  return sides_;
}

// A separate thread, so that delays of publication (a full log pipe, the ROS side of a plug-in) do
// not delay the goal of a motion.
void ManagerRos::goalLoop() {
  pthread_setname_np(pthread_self(), "goals");
  auto next = std::chrono::steady_clock::now();
  while (!stopping_) {
    for (const auto& side : sides()) {
      guarded("following of goals", [&side] { side->ros->pollGoal(); });
    }
    next = std::max(next + kPublishPeriod, std::chrono::steady_clock::now() - kPublishPeriod);
    std::this_thread::sleep_until(next);
  }
}

void ManagerRos::publishLoop() {
  pthread_setname_np(pthread_self(), "publisher");
  heartbeat_ns_ = steadyNow();
  auto next = std::chrono::steady_clock::now();
  for (std::uint64_t round = 0; !stopping_; ++round) {
    for (const auto& side : sides()) {
      guarded("publication of a controller", [&side] { side->ros->spinOnce(); });
    }
    guarded("publication", [this, round] {
      const CycleReport report = manager_->report();
      watch(report);
      publishTarget(report);
      if (round % 4 == 0) publishStatus(report);
      if (round % 40 == 0) feedback_->publishStatus();
      if (signals_) signals_->publish();
      if (round % 200 == 20) diagnostics_->force_update();  // not by ROS time
    });
    next = std::max(next + kPublishPeriod, std::chrono::steady_clock::now() - kPublishPeriod);
    std::this_thread::sleep_until(next);
  }
}

void ManagerRos::watch(const CycleReport&) {
  const std::uint64_t heartbeat = manager_->cycle().heartbeat();
  const std::int64_t now = steadyNow();
  if (heartbeat != heartbeat_) {
    heartbeat_ = heartbeat;
    heartbeat_ns_ = now;
    stalled_.clear();
    return;
  }
  const double silent = 1e-9 * static_cast<double>(now - heartbeat_ns_);
  if (silent < kStallTime || !stalled_.empty()) return;
  std::string id, type;
  manager_->active(id, type);
  stalled_ = manager_->cycle().inPlugin()
                 ? "controller '" + id + "' has stalled in its code: the arm was braked and holds"
                 : "the control thread does not run: the arm was braked and holds";
  ROS_ERROR("%s", stalled_.c_str());
}

void ManagerRos::publishTarget(const CycleReport& report) {
  if (!options_.publish_target || report.samples == published_samples_) return;
  published_samples_ = report.samples;
  if (report.active.empty()) return;
  target_message_.header.stamp = toRos(report.robot.stamp_ns);
  for (std::size_t joint = 0; joint < target_message_.velocity.size(); ++joint) {
    target_message_.velocity[joint] = report.velocity[static_cast<int>(joint)];
  }
  options_.target.publish(target_message_);
}

void ManagerRos::publishStatus(const CycleReport& report) {
  coglab_msgs::ControllerStatus message;
  manager_->active(message.active_controller, message.active_type);
  const Reason reason =
      stalled_.empty() ? report.reason : Reason(ReasonCode::CycleStalled, stalled_.c_str());
  message.state = stalled_.empty() ? nameOf(report.state) : "fault";
  message.standing = stalled_.empty() && report.standing;
  message.reason_code = reason.number();
  message.reason = reason.str();
  message.plan_generation = report.generation;
  message.speed_scale = report.speed_scale;
  const coglab_msgs::ControllerStatus& last = status_shown_;
  const bool same =
      message.active_controller == last.active_controller && message.state == last.state &&
      message.standing == last.standing && message.reason_code == last.reason_code &&
      message.plan_generation == last.plan_generation && message.speed_scale == last.speed_scale;
  const std::int64_t now = steadyNow();
  const bool due = 1e-9 * static_cast<double>(now - status_shown_ns_) >= kTellPeriod;
  if (shown_once_ && same && !due) return;
  status_shown_ns_ = now;
  if (report.fault && !shown_.fault) ROS_ERROR("%s", report.reason.c_str());
  shown_ = report;
  shown_once_ = true;
  message.header.stamp = ros::Time::now();
  status_shown_ = message;
  status_.publish(message);
}

void ManagerRos::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  const CycleReport report = manager_->report();
  const std::string warning = thread_->warning();
  ReasonCode code = report.reason.code();
  if (!stalled_.empty()) {
    code = ReasonCode::CycleStalled;
    status.summary(DiagnosticStatus::ERROR, stalled_);
  } else if (report.fault) {
    status.summary(DiagnosticStatus::ERROR, report.reason.str());
  } else if (!report.reason.empty()) {
    status.summary(DiagnosticStatus::WARN, report.reason.str());
  } else if (!warning.empty()) {
    code = ReasonCode::NoRealTime;
    status.summary(DiagnosticStatus::WARN, warning);
  } else if (!manager_->feedbackErrors().empty()) {
    status.summary(DiagnosticStatus::WARN, manager_->feedbackErrors().front());
  } else {
    status.summary(DiagnosticStatus::OK, nameOf(report.state));
  }
  status.add("reason_code", static_cast<int>(code));
  status.add("active controller", report.active.str());
  status.add("state", nameOf(report.state));
  status.add("cycles", report.cycles);
  status.add("cycles with a joint state", report.samples);
  status.add("cycles with an unusable joint state", report.stale);
  status.add("cycle time (s)", report.dt);
  status.add("duration of the last cycle (us)", 1e6 * report.duration);
  status.add("longest cycle (us)", 1e6 * report.longest);
  status.add("overruns", report.overruns);
  status.add("faults", report.faults);
  status.add("plan", report.generation);
  status.add("speed scale", report.speed_scale);
  status.add("time scale", report.time_scale);
  status.add("transforms refused", tf_listener_->refused());
  status.add("guard", describe(report.guard.reason));
  status.add("guard scale", report.guard.scale);
  status.add("real-time scheduling", warning.empty() ? "granted or not asked for" : warning);
}

}  // namespace coglab_controllers
