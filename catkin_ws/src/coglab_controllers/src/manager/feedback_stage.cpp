#include "coglab_controllers/manager/feedback_stage.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

namespace {

ctrl_more::RobotSignal declare(ctrl_more::RobotStates& store, ctrl_more::RobotSource source,
                               const std::string& key, int size, const std::string& unit,
                               const std::string& frame) {
  const ctrl_more::Status status = store.declare(source, key, size, unit, frame);
  if (!status.ok()) throw std::logic_error(status.message());
  return store.find(source, key);
}

template <int size>
ctrl_more::Reference<size> declare(ctrl_more::ControlStates& store,
                                   ctrl_more::ControlContainer container, const std::string& key,
                                   const std::string& unit, const std::string& frame) {
  const ctrl_more::Status status = store.declare(container, key, size, unit, frame);
  if (!status.ok()) throw std::logic_error(status.message());
  return store.find<size>(container, key);
}

ctrl_more::ManagerOptions options(bool lockstep) {
  ctrl_more::ManagerOptions options;
  options.timed = !lockstep;
  options.lockstep = lockstep;
  return options;
}

References makeReferences(double period, ctrl_more::Logger* logger) {
  using ctrl_more::ControlContainer;
  References references;
  references.states = ctrl_more::ControlStates(kMaxJoints, period, logger);
  ctrl_more::ControlStates& states = references.states;
  references.pose = declare<ctrl_more::Pose>(states, ControlContainer::TaskSpaceReferencePose, "ee",
                                             "m, quaternion x y z w", "base");
  references.twist = declare<ctrl_more::Twist>(states, ControlContainer::TaskSpaceReferenceVel,
                                               "ee", "m/s, rad/s", "base");
  references.joint_position = declare<kMaxJoints>(states, ControlContainer::JointSpaceReference,
                                                  "Position", "rad", "joints in wire order");
  references.joint_velocity = declare<kMaxJoints>(states, ControlContainer::JointSpaceReference,
                                                  "Velocity", "rad/s", "joints in wire order");
  references.speed_limit =
      declare<1>(states, ControlContainer::OtherReference, "speed_limit", "m/s", "hand and elbow");
  references.states.view(references.pose) << 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  return references;
}

}  // namespace

FeedbackStage::FeedbackStage(const RobotSetup& setup, double period, bool lockstep,
                             ctrl_more::Logger* logger)
    : tool_from_wrench_(setup.tool_from_wrench),
      robot_(logger),
      references_(makeReferences(period, logger)),
      options_(options(lockstep)),
      logger_(logger),
      central_(makeCentral(ctrl_more::ConfigNode::fromText(
                               "{managers: [feedback], feedback: {type: Feedback}}", "default"),
                           "", {})) {
  using ctrl_more::RobotSource;
  const std::string wire = "joints in wire order";
  position_ = declare(robot_, RobotSource::Measured, "joint_position", kMaxJoints, "rad", wire);
  velocity_ = declare(robot_, RobotSource::Measured, "joint_velocity", kMaxJoints, "rad/s", wire);
  torque_ = declare(robot_, RobotSource::Measured, "joint_torque", kMaxJoints, "Nm", wire);
  external_ = declare(robot_, RobotSource::Measured, "external_torque", kMaxJoints, "Nm", wire);
  wrench_ = declare(robot_, RobotSource::Measured, "wrench", 6, "N, Nm", "base");
  pose_ = declare(robot_, RobotSource::Estimated, "ee", 7, "m, quaternion x y z w", "base");
  arm_points_ = declare(robot_, RobotSource::Estimated, "arm_points", 9,
                        "m: elbow, wrist, tool frame", "base");
  elbow_joint_ = setup.chain.elbowJoint();
  wrist_joint_ = setup.chain.wristJoint();
  if (!setup.touch_topic.empty()) addSignals({touchSignal(setup.touch_topic, setup.tool_link)});
}

std::unique_ptr<ctrl_more::CentralModule> FeedbackStage::makeCentral(
    const ctrl_more::ConfigNode& file, const std::string& base,
    const std::vector<std::string>& folders) {
  return std::make_unique<ctrl_more::CentralModule>(
      file, base, ctrl_more::CentralModule::Host{robot_, references_.states, options_, folders},
      logger_);
}

void FeedbackStage::loadCentral(const std::string& file, const std::vector<std::string>& folders) {
  central_ = makeCentral(ctrl_more::ConfigNode::fromFile(file),
                         std::filesystem::path(file).parent_path().string(), folders);
}

std::vector<double> FeedbackStage::snapshotValues() const {
  const ctrl_more::ControlStates& states = references_.states;
  return {states.data(), states.data() + states.dataSize()};
}

void FeedbackStage::begin(std::int64_t now_ns, double dt) noexcept {
  now_ = {now_ns, dt, now_.number + 1};
  central_->begin(now_);
}

void FeedbackStage::end() noexcept {
  central_->end();
  if (!snapshots_) return;
  Snapshot& snapshot = snapshots_->back();
  snapshot.stamp_ns = now_.now_ns;
  std::copy_n(references_.states.data(), snapshot.values.size(), snapshot.values.data());
  snapshots_->publish();
}

bool FeedbackStage::fill(const CycleInput& input) noexcept {
  const RobotSample& sample = input.robot;
  const std::int64_t stamp = sample.stamp_ns;
  signals_.deliver(robot_, stamp);
  const Quaternion turn = input.chain.tool.orientation * tool_from_wrench_;
  coglab_rt::Vector6 wrench;
  wrench << turn * Vector3(sample.tool_wrench.head<3>()),
      turn * Vector3(sample.tool_wrench.tail<3>());
  Eigen::Matrix<double, 7, 1> pose;
  pose << input.chain.tool.position, input.chain.tool.orientation.coeffs();
  Eigen::Matrix<double, 9, 1> points;
  points << input.chain.origins.col(elbow_joint_), input.chain.origins.col(wrist_joint_),
      input.chain.tool.position;
  return robot_.write(position_, sample.position.data(), stamp) &&
         robot_.write(velocity_, sample.velocity.data(), stamp) &&
         robot_.write(torque_, sample.torque.data(), stamp) &&
         robot_.write(external_, sample.external_torque.data(), stamp) &&
         robot_.write(wrench_, wrench.data(), stamp) && robot_.write(pose_, pose.data(), stamp) &&
         robot_.write(arm_points_, points.data(), stamp);
}

}  // namespace coglab_controllers
