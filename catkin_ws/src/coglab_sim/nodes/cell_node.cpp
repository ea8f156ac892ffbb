/// The node /coglab_sim/cell: the simulated cell in real time, with UDP and topics.
///
/// Subscribes (relative names) human_hand, motor_commands, ~push (geometry_msgs/Wrench on the palm,
/// world axes). Publishes truth/cell, motor_states, ~messages (the controller's message window),
/// palm_imu (sensor_msgs/Imu), palm_wrench
/// (geometry_msgs/WrenchStamped), /clock if ~publish_clock, fingertip_forces if ~tactile,
/// real_time_factor (std_msgs/Float64, latched) and, on /diagnostics, whether this computer keeps
/// real time. If it does not and ~slow_down is set, the cell slows down. Stamps are the times of
/// the physics steps. Serves ~fault, ~place_object. Parameters: all rows of parameter_table.inc in
/// the private namespace; fri_period and seed in the parent namespace.
#include <fstream>
#include <memory>

#include <coglab_msgs/CellTruth.h>
#include <coglab_msgs/HumanHand.h>
#include <coglab_msgs/InjectFault.h>
#include <coglab_msgs/PlaceObject.h>
#include <coglab_msgs/ReasonCode.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/Wrench.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <std_msgs/Float64.h>
#include <std_msgs/String.h>

#include "cell_faults.hpp"
#include "cell_messages.hpp"
#include "cell_parameters.hpp"
#include "coglab_rt/ros/logger_service.hpp"
#include "coglab_rt/ros/node_start.hpp"
#include "coglab_sim/pace.hpp"
#include "coglab_sim/real_time_cell.hpp"
#include "port_wait.hpp"

namespace coglab_sim {
namespace {

constexpr int kQueue = 100;  // length of the queues for truth and touch

/// Full name of the parameter with the bridge's port. A relative name starts at the namespace above
/// the cell's: the bridge /a/lwr and the cell /a/coglab_sim/cell belong to one robot.
std::string portParameter(const std::string& name) {
  if (!name.empty() && name[0] == '/') return name;
  return ros::names::append(ros::names::parentNamespace(ros::this_node::getNamespace()), name);
}

/// Port that the bridge has published; 0: none yet.
std::uint16_t publishedPort(const std::string& parameter) {
  int port = 0;
  if (!ros::param::get(parameter, port) || port <= 0 || port > 65535) return 0;
  return static_cast<std::uint16_t>(port);
}

/// Waits for the bridge's port. @throws std::runtime_error after `limit` s or at shutdown.
std::uint16_t waitForPort(const std::string& parameter, double limit) {
  const ros::SteadyTime begun = ros::SteadyTime::now();
  ROS_INFO("waiting up to %.0f s for the bridge's port in parameter %s", limit, parameter.c_str());
  const std::uint16_t port = pollPort(
      limit, [&] { return publishedPort(parameter); },
      [&] { return (ros::SteadyTime::now() - begun).toSec(); },
      [&](double waited) {
        ROS_WARN("no bridge has set parameter %s for %.0f s; is it starting? Waiting up to %.0f s",
                 parameter.c_str(), waited, limit);
      },
      [] {
        ros::WallDuration(0.1).sleep();
        return ros::ok();
      });
  if (port != 0) return port;
  throw std::runtime_error("no bridge published its UDP port in parameter " + parameter +
                           " within " + std::to_string(limit) +
                           " s; start the bridge or set ~fri_port");
}

class CellNode {
 public:
  CellNode()
      : private_("~"),
        config_(readCellConfig(private_)),
        settings_(config_.node),
        pace_(settings_.speed),
        hand_(config_.hand_model.empty() ? plant::builtInHandTable()
                                         : plant::readHandTable(config_.hand_model)) {
    const double speed = pace_.factor(), rate = settings_.truth_rate;
    const std::string& host = settings_.fri_host;
    int port = settings_.fri_port;
    port_parameter_ = portParameter(settings_.port_parameter);
    follow_port_ = port == 0;
    if (follow_port_) port = waitForPort(port_parameter_, settings_.port_wait);
    cell_ = std::make_unique<RealTimeCell>(config_, host, static_cast<std::uint16_t>(port), speed,
                                           static_cast<std::uint16_t>(settings_.fri_source_port));
    cell_->setSnapshotInterval(speed / rate);
    cell_->waitForAnswers(settings_.slow_down);
    openLog(settings_.log_file);

    truth_ = node_.advertise<coglab_msgs::CellTruth>("truth/cell", kQueue);
    motor_states_ = node_.advertise<coglab_msgs::MotorStates>("motor_states", 1);
    messages_ = private_.advertise<std_msgs::String>("messages", 50, true);
    factor_ = node_.advertise<std_msgs::Float64>("real_time_factor", 1, true);
    diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 5);
    palm_imu_ = node_.advertise<sensor_msgs::Imu>("palm_imu", kQueue);
    palm_wrench_ = node_.advertise<geometry_msgs::WrenchStamped>("palm_wrench", kQueue);
    if (settings_.tactile)
      touch_ = node_.advertise<coglab_msgs::FingertipForces>("fingertip_forces", kQueue);
    if (settings_.publish_clock) clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 1);
    const auto hints = ros::TransportHints().tcpNoDelay();
    human_ = node_.subscribe<coglab_msgs::HumanHand>(
        "human_hand", 1, [this](const coglab_msgs::HumanHand::ConstPtr& m) { onHuman(*m); },
        nullptr, hints);
    motors_ = node_.subscribe<coglab_msgs::MotorCommands>(
        "motor_commands", 1,
        [this](const coglab_msgs::MotorCommands::ConstPtr& m) { onMotors(*m); }, nullptr, hints);
    push_ = private_.subscribe<geometry_msgs::Wrench>(
        "push", 1, [this](const geometry_msgs::Wrench::ConstPtr& m) { onPush(*m); });
    fault_ = private_.advertiseService("fault", &CellNode::onFault, this);
    place_ = private_.advertiseService("place_object", &CellNode::onPlace, this);

    publish_timer_ = node_.createSteadyTimer(ros::WallDuration(1.0 / rate),
                                             [this](const ros::SteadyTimerEvent&) { publish(); });
    log_timer_ = node_.createSteadyTimer(ros::WallDuration(0.1),
                                         [this](const ros::SteadyTimerEvent&) { writeLog(); });
    port_timer_ = node_.createSteadyTimer(ros::WallDuration(1.0),
                                          [this](const ros::SteadyTimerEvent&) { checkPort(); });
    pace_timer_ = node_.createSteadyTimer(ros::WallDuration(1.0),
                                          [this](const ros::SteadyTimerEvent&) { checkPace(); });
    publishFactor();
    ROS_INFO(
        "robot controller stand-in: FRI toward %s:%d every %.1f ms, KRL program %s, %.3g times "
        "real time",
        host.c_str(), port, 1e3 * config_.krc.period, krc::nameOf(config_.krc.convention).c_str(),
        speed);
    const std::string normal = cell_->start(settings_.rt_priority);
    if (normal.empty())
      ROS_INFO("its thread has SCHED_FIFO priority %d", settings_.rt_priority);
    else
      ROS_INFO("its thread is a normal one: %s", normal.c_str());
  }

  ~CellNode() {
    cell_->stop();
    writeLog();
  }

  /// True if the simulation has ended by itself; the reason has been logged.
  bool failed() const { return failed_; }

 private:
  void openLog(const std::string& path) {
    if (path.empty()) return;
    log_.open(path);
    if (!log_) throw std::runtime_error("log_file " + path + " cannot be written");
    log_ << "time,state,quality,power,control,answered";
    const char* joints[] = {"a1", "a2", "e1", "a3", "a4", "a5", "a6"};
    for (const char* kind : {"commanded_lwr_", "measured_lwr_"}) {
      for (const char* joint : joints) log_ << ',' << kind << joint;
    }
    log_ << '\n';
    log_.precision(9);
  }

  void writeLog() {
    for (const TickRecord& record : cell_->takeRecords()) {
      if (!log_.is_open()) continue;
      log_ << record.time << ',' << record.state << ',' << record.quality << ',' << record.power
           << ',' << record.control << ',' << record.answered;
      for (const Vector7* joints : {&record.commanded, &record.measured}) {
        for (int i = 0; i < 7; ++i) log_ << ',' << (*joints)[i];
      }
      log_ << '\n';
    }
    if (!log_.is_open()) return;
    log_.flush();
    if (log_) return;
    ROS_ERROR("log_file %s cannot be written any more, its last row may be cut; is the disk full?",
              settings_.log_file.c_str());
    log_.close();
  }

  void onPush(const geometry_msgs::Wrench& message) {
    const Vector3d force = vectorOf(message.force), torque = vectorOf(message.torque);
    if (!isWithin(force, 1000.0) || !isWithin(torque, 1000.0)) {
      ROS_WARN_THROTTLE(1.0, "push ignored: expected at most 1000 N and 1000 Nm");
      return;
    }
    cell_->setPush({force, torque});
  }

  void onHuman(const coglab_msgs::HumanHand& message) {
    plant::PersonInput human;
    human.twist = {vectorOf(message.velocity.linear), vectorOf(message.velocity.angular)};
    if (!poseOf(message.pose, human.hand) || !(message.grip >= 0.0 && message.grip <= 1.0) ||
        !(message.grip_force >= 0.0 && message.grip_force <= 1000.0) ||
        !isWithin(human.twist.linear, 100.0) || !isWithin(human.twist.angular, 100.0)) {
      ROS_WARN_THROTTLE(1.0,
                        "human_hand ignored: expected a pose within 100 m, at most 100 m/s and "
                        "100 rad/s, grip 0..1 and grip_force 0..1000 N");
      return;
    }
    ++hand_messages_;
    human.grip = message.grip;
    human.grip_force = message.grip_force;
    cell_->setHuman(human);
  }

  void onMotors(const coglab_msgs::MotorCommands& message) {
    try {
      cell_->setMotors(motorsOf(message));
    } catch (const std::invalid_argument& error) {
      ROS_WARN_THROTTLE(1.0, "motor_commands ignored: %s", error.what());
    }
  }

  bool onFault(coglab_msgs::InjectFault::Request& request,
               coglab_msgs::InjectFault::Response& response) {
    try {
      injectFault(*cell_, request.kind, request.value, request.duration);
      response.success = true;
      response.message = request.kind + " done";
      ROS_INFO("fault %s, value %g, duration %g s", request.kind.c_str(), request.value,
               request.duration);
    } catch (const std::invalid_argument& error) {
      response.reason_code = coglab_msgs::ReasonCode::INVALID_ARGUMENT;
      response.message = error.what();
    } catch (const std::exception& error) {
      response.reason_code = coglab_msgs::ReasonCode::UNEXPECTED;
      response.message = error.what();
    }
    return true;
  }

  bool onPlace(coglab_msgs::PlaceObject::Request& request,
               coglab_msgs::PlaceObject::Response& response) {
    try {
      const plant::Place where = placeOf(request.where);
      Pose pose;
      if (!poseOf(request.pose, pose))
        throw std::invalid_argument("pose needs finite numbers and a quaternion of length 1");
      plant::Object object = config_.object;
      const bool exchange = !request.object_id.empty() && request.object_id != config_.object.id;
      if (exchange) object = readObject(private_, request.object_id);
      cell_->apply([exchange, object, where, pose](Cell& cell) {
        const plant::Object before = cell.config().object;
        if (exchange) cell.setObject(object);
        try {
          cell.place(where, pose);
        } catch (...) {
          if (exchange) cell.setObject(before);
          throw;
        }
      });
      config_.object = object;
      response.success = true;
      response.message = object.id + " placed: " + request.where;
    } catch (const std::invalid_argument& error) {
      response.reason_code = coglab_msgs::ReasonCode::INVALID_ARGUMENT;
      response.message = error.what();
    } catch (const std::exception& error) {
      response.reason_code = coglab_msgs::ReasonCode::UNEXPECTED;
      response.message = error.what();
    }
    return true;
  }

  void publish() {
    const CellSnapshot snapshot = cell_->snapshot();
    if (const std::string failure = cell_->failure(); !failure.empty()) {
      ROS_FATAL("the simulated cell stopped: %s", failure.c_str());
      failed_ = true;
      ros::requestShutdown();
      return;
    }
    if (!snapshot.refused_hand.empty())
      ROS_WARN_THROTTLE(5.0, "human_hand ignored: %s", snapshot.refused_hand.c_str());
    // All snapshots, so that a late timer loses none.
    for (const CellSnapshot& each : cell_->takeSnapshots()) {
      const ros::Time stamp = stampOf(each, static_cast<bool>(clock_));
      if (clock_) {
        rosgraph_msgs::Clock clock;
        clock.clock = stamp;
        clock_.publish(clock);
      }
      truth_.publish(truthMessage(each.truth, config_.object.id, stamp));
      motor_states_.publish(motorsMessage(each.motors, stamp));
      if (palm_imu_.getNumSubscribers() > 0)
        palm_imu_.publish(imuMessage(each.palm, config_.palm_noise, stamp));
      if (palm_wrench_.getNumSubscribers() > 0)
        palm_wrench_.publish(wrenchMessage(each.palm, stamp));
      if (touch_) touch_.publish(touchMessage(each.touch, hand_, stamp));
    }
    for (const krc::Message& message : cell_->takeMessages()) {
      ROS_WARN("KRC %.3f s: %s", message.time, message.text.c_str());
      std_msgs::String text;
      text.data = message.text;
      messages_.publish(text);
    }
  }

  /// Follows a restarted bridge to its new port.
  void checkPort() {
    const CellSnapshot snapshot = cell_->snapshot();
    const bool silent = snapshot.answers == answers_seen_;
    answers_seen_ = snapshot.answers;
    const std::uint16_t port = follow_port_ && silent ? publishedPort(port_parameter_) : 0;
    if (port != 0) cell_->setPort(port);
    if (silent && snapshot.tick > 0)
      ROS_WARN_THROTTLE(10.0, "no FRI answer for 1 s; is the bridge running?");
  }

  /// Evaluates the computer's load over the last second and slows the cell down if necessary.
  void checkPace() {
    const CellSnapshot now = cell_->snapshot();
    const auto share = [](std::uint64_t part, std::uint64_t of) {
      return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : 0.0;
    };
    const double seconds = (ros::SteadyTime::now() - measured_at_).toSec() * pace_.factor();
    measured_at_ = ros::SteadyTime::now();
    ComputerLoad load;
    load.latest = cell_->takeLatest();
    load.late_steps = share(now.late_ticks - measured_.late_ticks, now.tick - measured_.tick);
    if (now.answers > measured_.answers)  // without answers there is no bridge
      load.lost_answers = share(now.unanswered - measured_.unanswered, now.sent - measured_.sent);
    // The person sends at a constant rate; use the highest seen.
    const double rate = seconds > 0.5 * pace_.factor() ? hand_messages_ / seconds : hand_rate_;
    hand_messages_ = 0;
    hand_rate_ = std::max(hand_rate_, std::min(rate, kHandRate));
    if (hand_rate_ > 0.5 * kHandRate && rate > 0.0)
      load.missing = 1.0 - std::min(1.0, rate / hand_rate_);
    const bool first = measured_.tick == 0;
    measured_ = now;
    if (first) return;  // no full second yet

    const bool before = pace_.busy();
    const double factor = pace_.factor();
    if (settings_.slow_down && pace_.update(load) != factor) {
      cell_->setFactor(pace_.factor());
      publishFactor();
    }
    const bool busy = settings_.slow_down ? pace_.busy() : load.tooBusy();
    const std::string sentence = describe(load, pace_.factor(), busy);
    if (pace_.factor() < factor || (busy && !before)) ROS_WARN("%s", sentence.c_str());
    if (pace_.factor() > factor) ROS_INFO("%s", sentence.c_str());
    publishLoad(load, busy, sentence);
  }

  void publishFactor() {
    std_msgs::Float64 message;
    message.data = pace_.factor();
    factor_.publish(message);
  }

  void publishLoad(const ComputerLoad& load, bool busy, const std::string& sentence) {
    diagnostic_msgs::DiagnosticArray array;
    array.header.stamp = ros::Time::now();
    array.status.resize(1);
    diagnostic_msgs::DiagnosticStatus& status = array.status.front();
    status.name = "coglab_sim: computer";
    status.hardware_id = "coglab_sim";
    status.level =
        busy ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK;
    status.message = sentence;
    const auto add = [&](const char* key, double value) {
      diagnostic_msgs::KeyValue row;
      row.key = key;
      char text[32];
      std::snprintf(text, sizeof text, "%.4g", value);
      row.value = text;
      status.values.push_back(row);
    };
    add("real time factor", pace_.factor());
    add("late cell steps (%)", 100.0 * load.late_steps);
    add("latest step (ms)", 1e3 * load.latest);
    add("late FRI answers (%)", 100.0 * load.lost_answers);
    add("missing node messages (%)", 100.0 * load.missing);
    diagnostics_.publish(array);
  }

  static constexpr double kHandRate = 100.0;  // Hz, of virtual_human.py, in simulated time

  ros::NodeHandle node_, private_;
  CellConfig config_;
  const NodeParameters& settings_;
  Pace pace_;
  plant::HandTable hand_;  // names of the phalanges
  std::unique_ptr<RealTimeCell> cell_;
  std::string port_parameter_;
  bool follow_port_ = false, failed_ = false;
  std::uint64_t answers_seen_ = 0;
  CellSnapshot measured_;  // at the last evaluation of the load
  ros::SteadyTime measured_at_ = ros::SteadyTime::now();
  double hand_messages_ = 0.0, hand_rate_ = 0.0;
  std::ofstream log_;
  ros::Publisher truth_, motor_states_, messages_, clock_, touch_, palm_imu_, palm_wrench_, factor_,
      diagnostics_;
  ros::Subscriber human_, motors_, push_;
  ros::ServiceServer fault_, place_;
  ros::SteadyTimer publish_timer_, log_timer_, port_timer_, pace_timer_;
};

}  // namespace
}  // namespace coglab_sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "cell");
  if (!coglab_rt::nameIsFree()) return 1;
  const ros::NodeHandle keep;  // destroying the last handle would end logging
  coglab_rt::LoggerServices logger_services;
  try {
    const coglab_sim::CellNode node;
    ros::spin();
    return node.failed() ? 1 : 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
