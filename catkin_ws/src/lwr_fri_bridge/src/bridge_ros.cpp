#include "lwr_fri_bridge/bridge_ros.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <thread>

#include <coglab_msgs/LwrState.h>

#include "bridge_diagnostics.hpp"
#include "lwr_fri_bridge/diagnosis.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr int kSpinnerThreads =
    4;  // a start may occupy one for seconds; hold and stop must get through
constexpr double kSilenceWarning = 5.0;  // s between warnings about silence

ros::Time rosTime(std::int64_t steady_ns) {
  const double age = 1e-9 * static_cast<double>(steadyNow() - steady_ns);
  const ros::Time now = ros::Time::now();
  return age > 0.0 && now.toSec() > age ? now - ros::Duration(age) : now;
}

void copyJoints(const Vector7& joints, std::vector<double>& values) {
  values.assign(joints.data(), joints.data() + joints.size());
}

double checkedRate(const ros::NodeHandle& nh) {
  const double rate = nh.param("joint_states_rate", 200.0);
  checkParameter("joint_states_rate", rate, 1.0, 1000.0);
  return rate;
}

}  // namespace

BridgeRos::BridgeRos(const ros::NodeHandle& nh, Options options)
    : nh_(nh),
      options_(std::move(options)),
      bridge_(readBridgeConfig(nh)),
      fri_thread_(bridge_, [this, &nh] {
        FriThreadOptions thread = readFriThreadOptions(nh);
        thread.after_answer = [this](bool answered) {
          if (options_.after_answer) options_.after_answer(answered);
          const std::int64_t now = steadyNow();
          if (now - last_post_ns_ < publish_period_ns_) return;
          last_post_ns_ = now;
          sem_post(&new_sample_);
        };
        return thread;
      }()) {
  // A little shorter than the period, so that an FRI period of the same length is not halved by
  // jitter.
  publish_period_ns_ = static_cast<std::int64_t>(0.9e9 / checkedRate(nh));
  nh_.setCallbackQueue(&queue_);
  sem_init(&new_sample_, 0, 0);
  bridge_.setVelocitySource(VelocitySource::Topic);
  for (const char* name : kJointNames) joint_message_.name.emplace_back(name);
  torque_message_.name = joint_message_.name;
  wrench_message_.header.frame_id = nh.param<std::string>("tool_frame", "ih2_palm");
}

BridgeRos::~BridgeRos() {
  shutdown();
  sem_destroy(&new_sample_);
}

void BridgeRos::start() {
  joint_states_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 10);
  external_torques_ = nh_.advertise<sensor_msgs::JointState>("external_torques", 10);
  tool_wrench_ = nh_.advertise<geometry_msgs::WrenchStamped>("tool_wrench", 10);
  state_ = nh_.advertise<coglab_msgs::LwrState>("state", 10, true);
  command_ = nh_.advertiseService("command", &BridgeRos::onCommand, this);
  events_ = nh_.subscribe("ros_events", 10, &BridgeRos::onEvent, this,
                          ros::TransportHints().tcpNoDelay());
  target_ = nh_.subscribe("target_joint_states", 1, &BridgeRos::onTarget, this,
                          ros::TransportHints().tcpNoDelay());

  if (nh_.param("lock_memory", true)) {
    const std::string warning = lockMemory();
    if (!warning.empty()) ROS_WARN("lwr: %s", warning.c_str());
  }
  started_ns_ = steadyNow();
  started_ = true;
  const std::string warning = fri_thread_.start(nh_.param("fri_port_bound", 0));
  if (!warning.empty()) ROS_WARN("lwr: %s", warning.c_str());
  nh_.setParam("fri_port_bound", fri_thread_.port());
  ROS_INFO("lwr: waiting for FRI datagrams on port %d, KRL convention %s", fri_thread_.port(),
           fri::nameOf(bridge_.config().krl_convention));

  diagnostics_ = std::make_unique<BridgeDiagnostics>(*this);
  diagnostics_timer_ = nh_.createTimer(ros::Duration(1.0),
                                       [this](const ros::TimerEvent&) { diagnostics_->publish(); });
  publisher_.start("lwr_publisher", 512 * 1024, [this] { publishLoop(); });
  spinner_ = std::make_unique<ros::AsyncSpinner>(kSpinnerThreads, &queue_);
  spinner_->start();
}

void BridgeRos::shutdown() {
  if (!started_) return;
  started_ = false;
  // No request is taken from now on. The topics stay registered: unregistering waits for the ROS
  // master, which may not answer, and the arm comes first.
  closing_ = true;
  Outcome outcome = bridge_.command("stop");
  // Somebody else's stop may be in progress; it has time limits of its own.
  for (int i = 0; i < 100 && outcome.code == OutcomeCode::Busy; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    outcome = bridge_.command("stop");
  }
  if (!outcome.success() && outcome.code != OutcomeCode::Disconnected) {
    // The log may be gone already when a node shuts down.
    std::fprintf(stderr, "lwr: shutdown: %s\n", describe(outcome).c_str());
  }
  stopping_ = true;
  diagnostics_timer_.stop();
  if (spinner_) spinner_->stop();
  sem_post(&new_sample_);
  publisher_.join();
  fri_thread_.stop();
}

void BridgeRos::unregister() {
  target_.shutdown();
  events_.shutdown();
  command_.shutdown();
  if (ros::ok()) nh_.deleteParam("fri_port_bound");
}

void BridgeRos::setControllerActive(bool active) {
  controller_active_ = active;
  bridge_.setVelocitySource(active ? VelocitySource::ControlThread : VelocitySource::Topic);
}

BridgeRos::Refused BridgeRos::refused() const {
  return {refused_invalid_, refused_active_, refused_second_, refused_blocked_};
}

void BridgeRos::onTarget(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  if (closing_) return;
  // In one process the controller manager publishes here what it sent already.
  if (options_.one_process && event.getPublisherName() == ros::this_node::getName()) return;
  if (options_.one_process && controller_active_) {
    ++refused_active_;
    ROS_WARN_THROTTLE(5.0,
                      "lwr: target_joint_states of %s refused: a controller of this process is "
                      "active; switch it off first",
                      event.getPublisherName().c_str());
    return;
  }
  // Two publishers would pull the arm to and fro: the one whose velocities are followed keeps it
  // until it pauses.
  const double pause = 1e-9 * static_cast<double>(steadyNow() - target_stamp_ns_);
  if (event.getPublisherName() != target_publisher_ && target_stamp_ns_ != 0 &&
      pause < bridge_.config().topic_timeout) {
    ++refused_second_;
    ROS_WARN_THROTTLE(5.0,
                      "lwr: target_joint_states of %s refused: %s moves the arm; switch its "
                      "controller off or end it first",
                      event.getPublisherName().c_str(), target_publisher_.c_str());
    return;
  }
  const sensor_msgs::JointState& message = *event.getMessage();
  std::string fault;
  VelocityCommand command;
  if (message.velocity.size() != 7) {
    fault = "expected 7 velocities, got " + std::to_string(message.velocity.size());
  } else if (!message.name.empty() && message.name.size() != 7) {
    fault = "expected 7 names or none, got " + std::to_string(message.name.size());
  } else {
    command.velocity.setConstant(NAN);
    for (std::size_t i = 0; i < 7; ++i) {
      std::size_t joint = i;
      if (!message.name.empty()) {
        joint = 0;
        while (joint < 7 && message.name[i] != kJointNames[joint]) ++joint;
        if (joint == 7) {
          fault = "unknown joint '" + message.name[i] +
                  "', expected lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6";
          break;
        }
      }
      command.velocity[static_cast<Eigen::Index>(joint)] = message.velocity[i];
    }
    if (fault.empty() && !command.velocity.allFinite())
      fault = "a velocity is not finite, or a joint is named twice";
  }
  if (!fault.empty()) {
    ++refused_invalid_;
    ROS_WARN_THROTTLE(5.0, "lwr: target_joint_states refused: %s", fault.c_str());
    return;
  }
  const Snapshot now = bridge_.snapshot();
  if (now.sample.block != MotionBlock::None) {
    ++refused_blocked_;
    ROS_WARN_THROTTLE(5.0, "lwr: target_joint_states refused: %s",
                      reasonOf(now.sample.block, now.sample.blocking_joint).c_str());
    // The leash lets go when the outward motion is not asked for any more, so it must hear what is
    // asked for.
    if (now.sample.block != MotionBlock::Leashed) return;
  }
  command.stamp_ns = steadyNow();
  command.motion_epoch = now.sample.motion_epoch;
  bridge_.sendTopicVelocity(command);
  target_publisher_ = event.getPublisherName();
  target_stamp_ns_ = command.stamp_ns;
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
    response.message = "this node is ending: the arm stops and takes no command";
    return true;
  }
  try {
    const Outcome outcome = bridge_.command(request.event);
    response.success = outcome.success();
    response.message = describe(outcome);
  } catch (const std::invalid_argument& error) {
    response.success = false;
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
    clock_gettime(CLOCK_REALTIME, &deadline);
    deadline.tv_nsec += 50'000'000;
    if (deadline.tv_nsec >= 1'000'000'000) {
      deadline.tv_nsec -= 1'000'000'000;
      ++deadline.tv_sec;
    }
    while (sem_timedwait(&new_sample_, &deadline) != 0 && errno == EINTR) {
    }
    while (sem_trywait(&new_sample_) == 0) {  // several posts, one newest sample
    }
    for (StateView view; bridge_.nextStateChange(view);) publishState(view);
    const Snapshot now = bridge_.snapshot();
    if (now.sample.sequence != published_sequence_) {
      published_sequence_ = now.sample.sequence;
      publishSample(now);
    }
    reportOutcomes();

    const FriThreadStatistics thread = fri_thread_.statistics();
    if (thread.foreign != 0 && foreign == 0) {
      ROS_WARN("lwr: a second sender, %s, uses the FRI port and is ignored; the peer is %s",
               thread.last_foreign.c_str(), thread.peer.c_str());
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

void BridgeRos::publishSample(const Snapshot& snapshot) {
  const RobotSample& sample = snapshot.sample;
  const ros::Time stamp = rosTime(sample.stamp_ns);
  joint_message_.header.stamp = stamp;
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
  message.reason = reasonOf(view.block, view.blocking_joint);
  message.cycle_time = view.cycle_time;
  state_.publish(message);
}

}  // namespace lwr_fri_bridge
