#include "coglab_controllers/ideal/ideal_arm_ros.hpp"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "coglab_rt/clock.hpp"
#include "coglab_rt/ros/joint_limits_parameter.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

using coglab_rt::Answer;
using coglab_rt::MotionBlock;
using coglab_rt::readNumber;
using coglab_rt::readParameter;
using coglab_rt::ReasonCode;
using coglab_rt::RobotSample;

namespace {

constexpr double kServeLimit = 1.0;  // s within which a tick must process a request
constexpr double kBrakeLimit = 3.0;  // s within which the arm must stand after `stop`
constexpr int kLateTicks = 20;       // periods of delay after which the arm's clock restarts
constexpr std::uint16_t kAllPower = 0x7F;
constexpr std::int64_t kStatePeriodNs =
    250'000'000;  // longest time between two publications of the state

/// Waits until the condition is true. Returns false after the time limit.
template <typename Condition>
bool waitFor(double limit, const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(limit);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

bool sameState(const IdealArmView& one, const IdealArmView& other) {
  return one.state == other.state && one.hold_latched == other.hold_latched &&
         one.sample.block == other.sample.block &&
         one.sample.motion_epoch == other.sample.motion_epoch;
}

}  // namespace

IdealArmConfig readIdealArmConfig(const ros::NodeHandle& node) {
  IdealArmConfig config;
  config.limits =
      coglab_rt::readJointLimits(node, "limits_file", "limits_profile", "lwr_description");
  config.period = readParameter<double>(node, "ideal_period", config.period, "a number");
  config.command_timeout =
      readParameter<double>(node, "command_timeout", config.command_timeout, "a number");
  const double* given = config.start_position.data();
  const auto start = readParameter<std::vector<double>>(node, "start_position", {given, given + 7},
                                                        "a list of 7 numbers");
  if (start.size() != 7) {
    throw std::invalid_argument("parameter " + node.resolveName("start_position") +
                                ": expected 7 numbers, got " + std::to_string(start.size()));
  }
  std::copy(start.begin(), start.end(), config.start_position.data());
  config.check();
  return config;
}

IdealArmRos::IdealArmRos(const ros::NodeHandle& node)
    : node_(node), arm_(readIdealArmConfig(node)) {
  node_.setCallbackQueue(&queue_);
  priority_ = static_cast<int>(readNumber(node_, "rt_priority", 80, 0, 98));
  const double rate = readNumber(node_, "joint_states_rate", 200.0, 1.0, 1000.0);
  publish_period_ = std::max(1.0 / rate, arm_.config().period);
  const auto& names = arm_.config().limits.names;
  joint_message_.name.assign(names.begin(), names.end());
}

IdealArmRos::~IdealArmRos() { shutdown(); }

void IdealArmRos::start(Wake wake) {
  wake_ = std::move(wake);
  joint_states_ = node_.advertise<sensor_msgs::JointState>("joint_states", 10);
  state_ = node_.advertise<coglab_msgs::LwrState>("state", 10, true);
  command_ = node_.advertiseService("command", &IdealArmRos::onCommand, this);
  events_ = node_.subscribe("ros_events", 10, &IdealArmRos::onEvent, this,
                            ros::TransportHints().tcpNoDelay());
  running_ = true;
  try {
    thread_.start("ideal_arm", 256 * 1024, [this] { armLoop(); });
    publisher_ = std::thread([this] { publishLoop(); });
    spinner_ = std::make_unique<ros::AsyncSpinner>(2, &queue_);
    spinner_->start();
  } catch (...) {
    shutdown();  // no thread may continue, because the caller frees the memory that it uses
    throw;
  }
  waitFor(kServeLimit, [this] { return scheduled_.load(); });
  ROS_INFO("lwr: an ideal arm: no FRI, no physics; a measurement every %g ms",
           1e3 * arm_.config().period);
}

void IdealArmRos::shutdown() {
  if (!running_) return;
  running_ = false;
  closing_ = true;
  arm_.request("stop");
  waitFor(kBrakeLimit, [this] { return arm_.served() == arm_.requested() && arm_.stands(); });
  arm_ends_ = true;
  thread_.join();
  if (spinner_) spinner_->stop();
  publisher_ends_ = true;
  if (publisher_.joinable()) publisher_.join();
}

void IdealArmRos::unregister() {
  events_.shutdown();
  command_.shutdown();
}

int IdealArmRos::highestPriority() { return real_time_ ? priority_ - 1 : 0; }

void IdealArmRos::armLoop() {
  std::string refused;
  if (priority_ > 0) refused = coglab_rt::enterRealTime(priority_);
  if (!refused.empty()) ROS_WARN("lwr: %s", refused.c_str());
  real_time_ = priority_ > 0 && refused.empty();
  scheduled_ = true;
  const auto period = static_cast<std::int64_t>(1e9 * arm_.config().period);
  std::int64_t next = coglab_rt::steadyNow();
  while (!arm_ends_.load(std::memory_order_relaxed)) {
    const std::int64_t now = coglab_rt::steadyNow();
    arm_.tick(now);
    if (wake_) wake_(true);
    next += period;
    if (now - next > kLateTicks * period) next = now + period;
    const timespec until{static_cast<time_t>(next / 1'000'000'000),
                         static_cast<long>(next % 1'000'000'000)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
  }
}

void IdealArmRos::publishLoop() {
  IdealArmView view, last;
  std::int64_t told_ns = std::numeric_limits<std::int64_t>::min() / 2;
  while (!publisher_ends_.load(std::memory_order_relaxed)) {
    if (arm_.newestView(view)) {
      const RobotSample& sample = view.sample;
      joint_message_.header.stamp = coglab_rt::toRos(sample.stamp_ns);
      const auto copy = [](const coglab_rt::Vector7& from, std::vector<double>& to) {
        to.assign(from.data(), from.data() + from.size());
      };
      copy(sample.position, joint_message_.position);
      copy(sample.velocity, joint_message_.velocity);
      copy(sample.torque, joint_message_.effort);
      joint_states_.publish(joint_message_);
      // Published again after a while, which shows that the node is alive.
      const std::int64_t now = coglab_rt::steadyNow();
      if (now - told_ns >= kStatePeriodNs || !sameState(view, last)) {
        publishState(view);
        told_ns = now;
      }
      last = view;
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(publish_period_));
  }
}

void IdealArmRos::publishState(const IdealArmView& view) {
  const MotionBlock block = view.sample.block;
  coglab_msgs::LwrState& message = state_message_;
  message.header.stamp = ros::Time::now();
  message.supervisor = nameOf(view.state);
  // The report of a robot controller without faults.
  message.fri_state = view.state == IdealArmState::Monitor ? "MON" : "CMD";
  message.quality = "PERFECT";
  message.control_mode = "POSITION";
  message.power = kAllPower;
  message.motion_allowed = block == MotionBlock::None;
  message.hold_latched = view.hold_latched;
  message.reason_code = static_cast<std::uint16_t>(coglab_rt::codeOf(block));
  message.reason = coglab_rt::describe(block);
  message.next_event = coglab_rt::nextEvent(block);
  message.motion_epoch = view.sample.motion_epoch;
  message.cycle_time = view.sample.cycle_time;
  state_.publish(message);
}

Answer IdealArmRos::request(const std::string& event) {
  if (closing_) {
    return Answer::refusal(ReasonCode::Stopping,
                           "this node is ending: the arm stops and takes no command");
  }
  Answer answer = arm_.request(event);
  if (!answer.success) return answer;
  const std::uint32_t number = arm_.requested();
  const bool stop = event == "stop";
  const bool settled = waitFor(stop ? kBrakeLimit : kServeLimit, [this, number, stop] {
    return arm_.served() - number < 0x80000000U && (!stop || arm_.stands());
  });
  if (!settled) {
    return Answer::refusal(ReasonCode::NotAdopted,
                           event +
                               ": the arm's thread did not get to it in time; relieve this "
                               "computer and ask again");
  }
  return answer;
}

void IdealArmRos::onEvent(const std_msgs::String& message) {
  const Answer answer = request(message.data);
  if (answer.success) {
    ROS_INFO("lwr: %s", answer.message.c_str());
  } else {
    ROS_WARN("lwr: ros_events: %s", answer.message.c_str());
  }
}

bool IdealArmRos::onCommand(coglab_msgs::LwrCommand::Request& request,
                            coglab_msgs::LwrCommand::Response& response) {
  const Answer answer = this->request(request.event);
  response.success = answer.success;
  response.reason_code = answer.number();
  response.message = answer.message;
  if (!answer.success)
    ROS_WARN("lwr: command '%s': %s", request.event.c_str(), answer.message.c_str());
  return true;
}

}  // namespace coglab_controllers
