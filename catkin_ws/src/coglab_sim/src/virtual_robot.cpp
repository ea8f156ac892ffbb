#include "coglab_sim/virtual_robot.hpp"
#include "coglab_rt/joint_limits_table.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

COGLAB_REGISTER_MOTION_CONTROLLER("coglab/DmpController", coglab_controllers::DmpController)
namespace coglab_sim {
namespace {
const coglab_controllers::MotionRegistration ptp_registration(
    "coglab/PtpController", {[]() -> coglab_controllers::MotionController* {
                               return new coglab_controllers::PtpController();
                             },
                             nullptr});

const coglab_controllers::MotionRegistration twist_registration(
    "coglab/TwistStream", {[]() -> coglab_controllers::MotionController* {
                             return new coglab_controllers::TwistStream();
                           },
                           nullptr});
const coglab_controllers::MotionRegistration joint_velocity_registration(
    "coglab/JointVelocityStream", {[]() -> coglab_controllers::MotionController* {
                                     return new coglab_controllers::JointVelocityStream();
                                   },
                                   nullptr});

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

lwr_fri_bridge::BridgeConfig bridgeConfig(const LockstepRobotConfig& config) {
  lwr_fri_bridge::BridgeConfig bridge;
  bridge.limits = coglab_rt::loadJointLimits(config.limits_file);
  bridge.position_margin = bridge.limits.position_margin;
  bridge.krl_convention =
      lwr_fri_bridge::fri::krlConventionFromName(krc::nameOf(config.cell.krc.convention));
  return bridge;
}

// Topics of cell_node, in the namespace of the robot.
const char* const kPalmImu = "coglab_sim/palm_imu";
const char* const kPalmWrench = "coglab_sim/palm_wrench";

bool sameTopic(const std::string& one, const std::string& other) {
  const auto begin = [](const std::string& name) { return name[0] == '/' ? 1U : 0U; };
  return one.compare(begin(one), std::string::npos, other, begin(other)) == 0;
}

std::vector<double> listOf(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

void WorldFrames::set(const std::string& frame, const Pose& in_world, std::int64_t stamp_ns) {
  frames_[frame] = {in_world, stamp_ns};
}

void WorldFrames::setFixed(const std::string& frame, const Pose& in_world) {
  frames_[frame] = {in_world, 0, true};
}

void WorldFrames::refresh(std::int64_t now_ns) {
  for (auto& [name, seen] : frames_)
    if (seen.fixed) seen.stamp_ns = now_ns;
}

bool WorldFrames::find(const std::string& frame, Seen& seen) const {
  if (frame == "world" || frame == "lwr_base_link") {
    seen = Seen{};
    return true;
  }
  const auto found = frames_.find(frame);
  if (found == frames_.end()) return false;
  seen = found->second;
  return true;
}

bool WorldFrames::lookup(const std::string& reference, const std::string& frame,
                         coglab_controllers::GoalObservation& observation, std::string& why) {
  Seen from, to;
  for (const auto& [name, seen] : {std::pair{&reference, &from}, std::pair{&frame, &to}}) {
    if (find(*name, *seen)) continue;
    why = "frame '" + *name + "' is not known";
    return false;
  }
  const Pose pose = from.pose.inverse() * to.pose;
  observation.position = pose.position;
  observation.orientation = pose.rotation;
  observation.stamp_ns = observation.frame_ns = to.stamp_ns;
  return true;
}

LockstepRobot::LockstepRobot(const LockstepRobotConfig& config)
    : cell_(config.cell), bridge_(bridgeConfig(config)), limits_(config.limits_file) {
  auto settings = coglab_controllers::readManagerSettings(YAML::Load(config.manager_parameters),
                                                          textOf(config.cell.urdf),
                                                          bridge_.config().limits, true);
  settings.clock = [this] { return now_ns_; };
  // The controllers are linked into this library, so that no plug-in library with ROS is needed.
  settings.types.erase("coglab/DmpController");
  settings.types.erase("coglab/PtpController");
  settings.logger = &logger_;
  manager_ = std::make_unique<coglab_controllers::ControllerManager>(std::move(settings));
  report_ = manager_->report();
  for (const auto& row : manager_->feedbackStage().signals().rows()) {
    has_palm_imu_ = has_palm_imu_ || sameTopic(row.topic, kPalmImu);
    has_palm_wrench_ = has_palm_wrench_ || sameTopic(row.topic, kPalmWrench);
  }
}

LockstepRobot::~LockstepRobot() {
  for (auto* dmp : dmps_) dmp->setGoalSource(nullptr);
}

coglab_controllers::Answer LockstepRobot::load(const std::string& id, const std::string& type) {
  coglab_controllers::Answer answer = manager_->load(id, type);
  if (!answer.success) return answer;
  if (auto* dmp = dynamic_cast<coglab_controllers::DmpController*>(manager_->motion(id))) {
    dmp->setGoalSource(&frames_);
    dmps_.push_back(dmp);
  }
  return answer;
}

coglab_controllers::Answer LockstepRobot::add(
    const std::string& id, const std::string& type,
    std::unique_ptr<coglab_controllers::Motion<>> motion) {
  return manager_->load(id, type,
                        std::unique_ptr<coglab_controllers::MotionController>(
                            coglab_controllers::CustomMotionController::make(std::move(motion))));
}

coglab_controllers::CustomMotionController& LockstepRobot::motion(const std::string& id) {
  using coglab_controllers::CustomMotionController;
  if (auto* motion = dynamic_cast<CustomMotionController*>(manager_->motion(id))) return *motion;
  throw std::invalid_argument("no motion of your own is loaded under the id '" + id +
                              "'; add_motion() loads one");
}

coglab_controllers::DmpController& LockstepRobot::dmp(const std::string& id) {
  if (auto* dmp = dynamic_cast<coglab_controllers::DmpController*>(manager_->motion(id)))
    return *dmp;
  throw std::invalid_argument("no DMP controller is loaded under the id '" + id + "'");
}

coglab_controllers::PtpController& LockstepRobot::ptp(const std::string& id) {
  if (auto* ptp = dynamic_cast<coglab_controllers::PtpController*>(manager_->motion(id)))
    return *ptp;
  throw std::invalid_argument("no point-to-point controller is loaded under the id '" + id + "'");
}

coglab_controllers::StreamController& LockstepRobot::stream(const std::string& id) {
  if (auto* stream = dynamic_cast<coglab_controllers::StreamController*>(manager_->motion(id)))
    return *stream;
  throw std::invalid_argument("no stream of velocities is loaded under the id '" + id +
                              "'; open_stream() loads it");
}

void LockstepRobot::tick() {
  std::array<std::uint8_t, lwr_fri_bridge::fri::kCommandSize> bytes{};
  frames_.refresh(now_ns_);
  const bool answered = !frozen_ && answer(bytes);
  if (!frozen_) controlCycle(answered);
  const double period = cell_.period();
  cell_.step(answered ? bytes.data() : nullptr, bytes.size());
  measured_ = cell_.sent();
  now_ns_ += static_cast<std::int64_t>(std::llround(1e9 * cell_.period()));
  postPalm();
  limits_.lookAtArm(cell_.plant().position(), cell_.fastest());
  report_ = manager_->report();
  const auto& robot = report_.robot;
  if (robot.cycle_time > 0.0) {
    limits_.lookAtCommand(robot.commanded_position, robot.block == coglab_rt::MotionBlock::None,
                          period);
  }
}

void LockstepRobot::postPalm() {
  const PalmReading& palm = cell_.palmSensors();
  if (has_palm_imu_) {
    const Quaterniond& q = palm.orientation;
    postSignal(kPalmImu,
               {{"orientation", {q.x(), q.y(), q.z(), q.w()}},
                {"angular_velocity", listOf(palm.angular_velocity)},
                {"linear_acceleration", listOf(palm.linear_acceleration)}},
               0.0, plant::kPalmFrame, {});
  }
  if (has_palm_wrench_) {
    const Vector3d& f = palm.force;
    const Vector3d& t = palm.torque;
    postSignal(kPalmWrench,
               {{"force", listOf(f)},
                {"torque", listOf(t)},
                {"wrench", {f.x(), f.y(), f.z(), t.x(), t.y(), t.z()}}},
               0.0, plant::kPalmFrame, {});
  }
}

std::string LockstepRobot::postSignal(const std::string& topic,
                                      const std::map<std::string, std::vector<double>>& numbers,
                                      double age, const std::string& frame,
                                      const std::vector<std::string>& joints) {
  auto& inputs = manager_->feedbackStage().signals();
  coglab_controllers::SignalMessage message;
  message.stamp_ns = now_ns_ - static_cast<std::int64_t>(std::llround(1e9 * age));
  message.frame = frame;
  message.joint_names = joints;
  std::string refused;
  for (std::size_t i = 0; i < inputs.rows().size(); ++i) {
    const coglab_controllers::SignalInput& row = inputs.rows()[i];
    if (!sameTopic(row.topic, topic)) continue;
    if (message.fields.empty()) {
      for (const coglab_controllers::SignalField& field : row.type->fields) {
        const auto found = numbers.find(field.name);
        message.fields.emplace_back();
        if (found == numbers.end()) continue;
        message.fields.back() = {found->second.data(), found->second.size()};
      }
      for (const auto& [name, values] : numbers) {
        const auto& fields = row.type->fields;
        if (std::none_of(fields.begin(), fields.end(),
                         [&name = name](const auto& field) { return field.name == name; })) {
          throw std::invalid_argument(row.type->name + " has no field '" + name + "'");
        }
      }
    }
    const coglab_controllers::SignalPost post = inputs.post(i, message, now_ns_);
    if (!post.text.empty()) refused = row.key + ": " + post.text;
  }
  if (message.fields.empty()) {
    throw std::invalid_argument("no row of the file of signals has the topic '" + topic + "'");
  }
  return refused;
}

bool LockstepRobot::answer(std::array<std::uint8_t, lwr_fri_bridge::fri::kCommandSize>& bytes) {
  if (!measured_) {
    bridge_.idle(now_ns_);
    return false;
  }
  lwr_fri_bridge::fri::CommandDatagram command;
  const MeasurementBytes& measurement = cell_.measurement();
  if (!bridge_.answer(measurement.data(), measurement.size(), now_ns_, command)) return false;
  lwr_fri_bridge::fri::encode(command, bytes.data());
  return true;
}

void LockstepRobot::controlCycle(bool answered) {
  for (auto* dmp : dmps_) dmp->pollGoal();
  auto& cycle = manager_->cycle();
  const double period = cell_.period(), wanted = cycle.settings().cycle_time;
  const int periods = std::max(1, static_cast<int>(std::ceil(wanted / period - 1e-6)));
  if (!answered) {
    cycle.idle(now_ns_);
    return;
  }
  if (++since_cycle_ < periods) return;
  since_cycle_ = 0;
  coglab_controllers::RobotSample sample;
  bridge_.mailboxes().newestSample(sample);
  const double dt = last_controller_ns_ == 0
                        ? wanted
                        : 1e-9 * static_cast<double>(sample.controller_ns - last_controller_ns_);
  last_controller_ns_ = sample.controller_ns;
  coglab_controllers::VelocityCommand command;
  cycle.run(sample, std::min(dt, cycle.settings().sample_timeout), command);
  bridge_.mailboxes().sendVelocity(command);
}

}  // namespace coglab_sim
