#include "lwr_fri_bridge/ros/bridge_ros.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include <coglab_msgs/LwrState.h>
#include <coglab_msgs/ReasonCode.h>
#include <std_msgs/Float64.h>

#include "bridge_diagnostics.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "coglab_rt/ros/ros_time.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "target_topic.hpp"

namespace lwr_fri_bridge {
namespace {

using coglab_rt::readNumber;
using coglab_rt::readParameter;

// A start may occupy one thread for seconds. The others are for hold and stop.
constexpr int kSpinnerThreads = 4;
constexpr std::int64_t kLatencyPeriodNs = 50'000'000;  // period of fri_latency
constexpr std::int64_t kStatePeriodNs = 250'000'000;   // period of state without a change
constexpr double kSilenceWarning = 5.0;                // s between warnings about silence

void copyJoints(const Vector7& joints, std::vector<double>& values) {
  values.assign(joints.data(), joints.data() + joints.size());
}

}  // namespace

BridgeRos::BridgeRos(const ros::NodeHandle& nh, bool one_process)
    : nh_(nh),
      one_process_(one_process),
      bridge_(readBridgeConfig(nh)),
      fri_thread_(bridge_, [this, &nh] {
        FriThreadOptions thread = readFriThreadOptions(nh);
        thread.after_answer = [this](bool answered) {
          if (wake_) wake_(answered);
          const std::int64_t now = steadyNow();
          if (now - last_post_ns_ < publish_period_ns_) return;
          last_post_ns_ = now;
          sem_post(&new_sample_);
        };
        return thread;
      }()) {
  // A little shorter than the period. Otherwise jitter would halve the rate if the FRI period has
  // the same length.
  publish_period_ns_ =
      static_cast<std::int64_t>(0.9e9 / readNumber(nh, "joint_states_rate", 200.0, 1.0, 1000.0));
  nh_.setCallbackQueue(&queue_);
  sem_init(&new_sample_, 0, 0);
  bridge_.setVelocitySource(VelocitySource::Topic);
  target_ = std::make_unique<TargetTopic>(bridge_, one_process_);
  for (const char* name : kJointNames) joint_message_.name.emplace_back(name);
  torque_message_.name = joint_message_.name;
  restarts_quietly_ = readParameter(nh, "quiet_restart", true, "true or false");
  wrench_message_.header.frame_id =
      readParameter<std::string>(nh, "tool_frame", "ih2_palm", "a name");
}

BridgeRos::~BridgeRos() {
  shutdown();
  sem_destroy(&new_sample_);
}

void BridgeRos::start(Wake wake) {
  wake_ = std::move(wake);
  try {
    startThreads();
  } catch (...) {
    endThreads();  // the caller frees what the threads use
    throw;
  }
  started_ = true;
}

void BridgeRos::startThreads() {
  stopping_ = false;
  started_ns_ = steadyNow();
  // Binds the port first: it is the most likely step to fail, and the others take longer.
  const std::string warning =
      fri_thread_.start(readParameter(nh_, "fri_port_bound", 0, "a whole number"));
  if (!warning.empty()) ROS_WARN("lwr: %s", warning.c_str());
  diagnostics_ = std::make_unique<BridgeDiagnostics>(*this);
  if (readParameter(nh_, "lock_memory", true, "true or false")) {
    const std::string refused = coglab_rt::lockMemory();
    if (!refused.empty()) ROS_WARN("lwr: %s", refused.c_str());
  }
  joint_states_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 10);
  external_torques_ = nh_.advertise<sensor_msgs::JointState>("external_torques", 10);
  tool_wrench_ = nh_.advertise<geometry_msgs::WrenchStamped>("tool_wrench", 10);
  state_ = nh_.advertise<coglab_msgs::LwrState>("state", 10, true);
  fri_latency_ = nh_.advertise<std_msgs::Float64>("fri_latency", 1);
  command_ = nh_.advertiseService("command", &BridgeRos::onCommand, this);
  events_ = nh_.subscribe("ros_events", 10, &BridgeRos::onEvent, this,
                          ros::TransportHints().tcpNoDelay());
  target_->start(nh_);
  nh_.setParam("fri_port_bound", fri_thread_.port());
  ROS_INFO("lwr: waiting for FRI datagrams on port %d, KRL convention %s", fri_thread_.port(),
           fri::nameOf(bridge_.config().krl_convention));

  diagnostics_timer_ = nh_.createSteadyTimer(
      ros::WallDuration(1.0), [this](const ros::SteadyTimerEvent&) { diagnostics_->publish(); });
  publisher_.start("lwr_publisher", 512 * 1024, [this] { publishLoop(); });
  spinner_ = std::make_unique<ros::AsyncSpinner>(kSpinnerThreads, &queue_);
  spinner_->start();
}

void BridgeRos::endThreads() {
  stopping_ = true;
  diagnostics_timer_.stop();
  if (spinner_) spinner_->stop();
  sem_post(&new_sample_);
  publisher_.join();
  fri_thread_.stop();
}

void BridgeRos::shutdown() {
  if (!started_) return;
  started_ = false;
  // Refuses all requests from now on. The arm must stop first. The topics stay registered, because
  // unregistering waits for the ROS master, which may not answer.
  closing_ = true;
  target_->close();
  Outcome outcome = bridge_.command("stop");
  // Another stop may be in progress. It has its own time limits.
  for (int i = 0; i < 100 && outcome.code == OutcomeCode::Busy; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    outcome = bridge_.command("stop");
  }
  if (!outcome.success() && outcome.code != OutcomeCode::Disconnected) {
    // The ROS log may no longer exist when a node shuts down.
    std::fprintf(stderr, "lwr: shutdown: %s\n", describe(outcome).c_str());
  }
  endThreads();
}

void BridgeRos::unregister() {
  target_->stop();
  events_.shutdown();
  command_.shutdown();
  if (ros::ok()) nh_.deleteParam("fri_port_bound");
}

int BridgeRos::highestPriority() {
  return fri_thread_.statistics().real_time ? fri_thread_.priority() - 1 : 0;
}

void BridgeRos::setControllerActive(bool active) {
  target_->setControllerActive(active);
  bridge_.setVelocitySource(active ? VelocitySource::ControlThread : VelocitySource::Topic);
}

void BridgeRos::onEvent(const std_msgs::String& message) {
  if (closing_) return;
  try {
    const std::uint32_t ticket = bridge_.submit(message.data);
    const std::lock_guard<std::mutex> lock(tickets_mutex_);
    tickets_.push_back(ticket);
  } catch (const std::invalid_argument& error) {
    ROS_WARN("lwr: ros_events: %s", error.what());
  }
}

bool BridgeRos::onCommand(coglab_msgs::LwrCommand::Request& request,
                          coglab_msgs::LwrCommand::Response& response) {
  if (closing_) {
    response.reason_code = coglab_msgs::ReasonCode::STOPPING;
    response.message = "this node is ending: the arm stops and takes no command";
    return true;
  }
  try {
    const Outcome outcome = bridge_.command(request.event);
    response.success = outcome.success();
    response.reason_code = static_cast<std::uint16_t>(codeOf(outcome.code));
    response.message = describe(outcome);
  } catch (const std::invalid_argument& error) {
    response.success = false;
    response.reason_code = coglab_msgs::ReasonCode::INVALID_ARGUMENT;
    response.message = error.what();
  }
  if (!response.success)
    ROS_WARN("lwr: command '%s': %s", request.event.c_str(), response.message.c_str());
  return true;
}

void BridgeRos::reportOutcomes() {
  const std::lock_guard<std::mutex> lock(tickets_mutex_);
  for (auto ticket = tickets_.begin(); ticket != tickets_.end();) {
    const Outcome outcome = bridge_.outcome(*ticket);
    if (outcome.code == OutcomeCode::Pending) {
      ++ticket;
      continue;
    }
    if (outcome.success()) {
      ROS_INFO("lwr: %s", describe(outcome).c_str());
    } else {
      ROS_WARN("lwr: %s", describe(outcome).c_str());
    }
    ticket = tickets_.erase(ticket);
  }
}

void BridgeRos::publishLoop() {
  std::uint64_t foreign = 0;
  std::int64_t last_warning_ns = steadyNow();
  while (!stopping_) {
    timespec deadline{};
    clock_gettime(CLOCK_MONOTONIC, &deadline);
    deadline.tv_nsec += 50'000'000;
    if (deadline.tv_nsec >= 1'000'000'000) {
      deadline.tv_nsec -= 1'000'000'000;
      ++deadline.tv_sec;
    }
    while (sem_clockwait(&new_sample_, CLOCK_MONOTONIC, &deadline) != 0 && errno == EINTR) {
    }
    while (sem_trywait(&new_sample_) == 0) {  // several posts for one newest sample
    }
    publishStates();
    const Snapshot now = bridge_.snapshot();
    if (now.sample.sequence != published_sequence_) {
      published_sequence_ = now.sample.sequence;
      publishSample(now);
    }
    restartQuietly(now);
    reportOutcomes();

    const FriThreadStatistics thread = fri_thread_.statistics();
    if (thread.foreign != 0 && foreign == 0) {
      const std::string& address = fri_thread_.controllerAddress();
      const std::string peer =
          address.empty() ? "the peer is " + thread.peer +
                                "; if that is not the robot controller, set controller_address"
                          : "controller_address is " + address;
      ROS_WARN("lwr: a second sender, %s, uses the FRI port and is ignored; %s",
               thread.last_foreign.c_str(), peer.c_str());
    }
    foreign = thread.foreign;
    const std::int64_t since = now.sample.stamp_ns != 0 ? now.sample.stamp_ns : started_ns_;
    const double silence = 1e-9 * static_cast<double>(steadyNow() - since);
    if (now.supervisor == SupervisorState::Disconnected && silence > kSilenceWarning &&
        1e-9 * static_cast<double>(steadyNow() - last_warning_ns) > kSilenceWarning) {
      last_warning_ns = steadyNow();
      ROS_WARN("lwr: %s",
               diagnoseConnection(now, thread, fri_thread_.port(), silence).text.c_str());
    }
  }
}

/// Restarts after a loss of command mode that this computer caused, if the arm has not moved since.
void BridgeRos::restartQuietly(const Snapshot& now) {
  if (!restarts_quietly_) return;
  QuietRestart::View view;
  view.loss = now.loss;
  view.stopped = now.supervisor == SupervisorState::Stopped;
  view.held = now.hold_latched;
  view.may_command = now.quality >= fri::Quality::Ok && now.drive_error == 0;
  view.timestamp = now.timestamp;
  view.position = now.sample.position;
  view.velocity = now.sample.velocity;
  if (!quiet_restart_.due(view, steadyNow())) return;
  ROS_WARN("lwr: %s; the arm was at rest and has not moved since: started again",
           describe(now.loss).c_str());
  const std::lock_guard<std::mutex> lock(tickets_mutex_);
  tickets_.push_back(bridge_.submit("start"));
}

void BridgeRos::publishSample(const Snapshot& snapshot) {
  const RobotSample& sample = snapshot.sample;
  const ros::Time stamp = coglab_rt::toRos(sample.stamp_ns);
  joint_message_.header.stamp = stamp;
  // The stamp is the time of receipt, which is late on a busy computer. To differentiate, use the
  // controller's time here.
  joint_message_.header.frame_id = std::to_string(sample.controller_ns);
  copyJoints(sample.position, joint_message_.position);
  copyJoints(sample.velocity, joint_message_.velocity);
  copyJoints(sample.torque, joint_message_.effort);
  joint_states_.publish(joint_message_);

  torque_message_.header.stamp = stamp;
  copyJoints(sample.external_torque, torque_message_.effort);
  external_torques_.publish(torque_message_);

  wrench_message_.header.stamp = stamp;
  wrench_message_.wrench.force.x = sample.tool_wrench[0];
  wrench_message_.wrench.force.y = sample.tool_wrench[1];
  wrench_message_.wrench.force.z = sample.tool_wrench[2];
  wrench_message_.wrench.torque.x = sample.tool_wrench[3];
  wrench_message_.wrench.torque.y = sample.tool_wrench[4];
  wrench_message_.wrench.torque.z = sample.tool_wrench[5];
  tool_wrench_.publish(wrench_message_);

  if (sample.stamp_ns - latency_published_ns_ < kLatencyPeriodNs) return;
  latency_published_ns_ = sample.stamp_ns;
  std_msgs::Float64 latency;
  latency.data = snapshot.latency;
  fri_latency_.publish(latency);
}

/// Publishes every change, and repeats the newest state every 0.25 s, so that subscribers can
/// detect a silent node.
void BridgeRos::publishStates() {
  bool published = false;
  for (StateView view; bridge_.nextStateChange(view); published = true) {
    newest_state_ = view;
    publishState(view);
  }
  const std::int64_t now = steadyNow();
  if (published) {
    state_published_ns_ = now;
  } else if (state_published_ns_ != 0 && now - state_published_ns_ >= kStatePeriodNs) {
    state_published_ns_ = now;
    publishState(newest_state_);
  }
}

void BridgeRos::publishState(const StateView& view) {
  coglab_msgs::LwrState message;
  message.header.stamp = ros::Time::now();
  message.supervisor = nameOf(view.supervisor);
  message.fri_state = fri::nameOf(view.state);
  message.quality = fri::nameOf(view.quality);
  message.control_mode = fri::nameOf(view.control);
  message.power = view.power;
  message.drive_error = view.drive_error;
  message.drive_warning = view.drive_warning;
  message.motion_allowed = view.block == MotionBlock::None;
  message.hold_latched = view.hold_latched;
  message.reason_code = static_cast<std::uint16_t>(codeOf(view.block, view.loss));
  message.reason = reasonOf(view.block, view.blocking_joint, view.loss);
  message.next_event = nextEvent(view.block);
  message.motion_epoch = view.motion_epoch;
  message.cycle_time = view.cycle_time;
  state_.publish(message);
}

}  // namespace lwr_fri_bridge
