#include "coglab_controllers/motion/reference_loop.hpp"

#include <algorithm>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {

using Space = MotionReference::Space;

// m/s, return speed of a hand that limits kept from its set-point; a person may be near.
constexpr double kCorrectionSpeed = 0.3;

Reason Arrival::handStuck(double away) noexcept {
  return Reason(ReasonCode::TargetNotReached, "the hand does not come to the goal: ")
         << away << " m are left; is the arm blocked?";
}

// Makes the second task of the parameter `second_task`; null for the orientation, which TwoTaskIk
// contains.
void ReferenceLoop::configureSecondTask(const Parameters& parameters, double largest_gain) {
  const std::string task =
      parameters.choice("second_task", "orientation", {"orientation", "axis", "posture", "none"});
  if (task == "axis") {
    const Vector3 axis = parameters.numbers("axis", Vector3(1.0, 0.0, 0.0), 1.0);
    if (axis.norm() < 1e-3) parameters.refuse("axis", "three numbers that are not all zero");
    second_task_ = std::make_unique<AxisTask>(axis, rotation_gain_->wanted());
  } else if (task == "posture") {
    if (!parameters.has("posture")) {
      parameters.refuse("posture", "seven joint positions (rad), because second_task is posture");
    }
    const JointVector posture = parameters.numbers("posture", JointVector::Zero(), 6.3);
    second_task_ = std::make_unique<PostureTask>(
        posture, parameters.number("posture_gain", std::min(1.0, largest_gain), 0.0, largest_gain));
  } else if (task == "none") {
    second_task_ = std::make_unique<NoTask>();
  }
}

void ReferenceLoop::configure(const MotionSetup& setup, Spaces spaces, Tunables& tunables) {
  robot_ = setup.robot;
  const Parameters parameters(setup.parameters, setup.id);
  IkParameters ik;
  ik.correction_speed = kCorrectionSpeed;
  if (spaces != Spaces::Joint) {
    const double most = std::min(200.0, largestGain(setup.cycle_time));
    position_gain_ = &tunables.add(parameters, "pos_clik_gain",
                                   "K_pos of eq. (6), 1/s: rate at which a position error decays",
                                   std::min(ik.pos_clik_gain, most), 0.0, most);
    rotation_gain_ =
        &tunables.add(parameters, "rot_clik_gain", "K_rot of eq. (7), 1/s: the same for rotation",
                      std::min(ik.rot_clik_gain, most), 0.0, most);
    correction_speed_ = &tunables.add(parameters, "correction_speed",
                                      "m/s, largest speed that corrects a position error",
                                      kCorrectionSpeed, 1e-3, 10.0);
    ik.pos_clik_gain = position_gain_->wanted();
    ik.rot_clik_gain = rotation_gain_->wanted();
    ik.correction_speed = correction_speed_->wanted();
    configureSecondTask(parameters, most);
  }
  ik.singularity_threshold =
      parameters.number("singularity_threshold", ik.singularity_threshold, 1e-6, 1.0);
  ik.rotation_first_scaling = parameters.flag("rotation_first_scaling", ik.rotation_first_scaling);
  ik.velocity_limit = robot_->limits.velocity;
  ik.acceleration_limit = robot_->limits.acceleration;
  ik.jerk_limit = robot_->limits.jerk;
  ik_ = std::make_unique<TwoTaskIk>(ik);
  if (spaces != Spaces::Pose) {
    const double most = std::min(100.0, largestGain(setup.cycle_time));
    joint_gain_ =
        &tunables.add(parameters, "Kp", "1/s, how fast an error of a joint's position goes",
                      std::min(gain_, most), 0.0, most);
    gain_ = joint_gain_->wanted();
  }
  tolerance_ = parameters.number("tolerance", tolerance_, 1e-5, 0.1);
  arrive_distance_ = parameters.number("arrive_distance", arrive_distance_, 1e-4, 0.5);
  blend_.setTime(parameters.number("hold_blend", 0.15, 0.0, 5.0));
}

void ReferenceLoop::begin() noexcept {
  correction_ = {};
  open();
}

void ReferenceLoop::open() noexcept {
  reference_.rest();
  hold_.begin();
}

void ReferenceLoop::write(const CycleInput& input, const MotionReference& reference,
                          References& references) noexcept {
  const Space before = reference_.space;
  reference_ = reference;
  // Corrections end at once when the arm must rest. While it rests it may be moved by hand. In both
  // cases it holds its position at that time.
  const bool anew = input.resting != resting_;
  resting_ = input.resting;
  if (reference.space == Space::Rest) {
    if (before != Space::Rest || anew) hold_.begin();
    // A correction that ends in this cycle is part of the rest position.
    if (anew && input.resting) correction_ = {};
    hold_.computeReference(input, *robot_, correction_, references);
    pose_ = references.states.view<7>(references.pose);
    return;
  }
  if (reference.jumps || reference.space != before) beginBlend(input);
  if (reference.space == Space::Joint) {
    references.states.view<kMaxJoints>(references.joint_position) = reference.joint_position;
    references.states.view<kMaxJoints>(references.joint_velocity) = reference.joint_velocity;
    // The present pose of the tool, for feedback controllers that use it.
    writePose(references, input.chain.tool);
    references.states.view<6>(references.twist).setZero();
  } else {
    writePose(references, reference.tool.pose);
    references.states.view<6>(references.twist) << reference.tool.velocity,
        reference.tool.angular_velocity;
  }
  pose_ = references.states.view<7>(references.pose);
}

void ReferenceLoop::beginBlend(const CycleInput& input) noexcept {
  if (reference_.space == Space::Joint) {
    blend_.begin(Vector3::Zero(), Vector3::Zero(),
                 reference_.joint_position - input.robot.position);
    return;
  }
  const Pose& measured = input.chain.tool;
  const Pose reference = correction_.onto(reference_.tool.pose);
  blend_.begin(reference.position - measured.position,
               rotationBetween(measured.orientation, reference.orientation), JointVector::Zero());
}

/// Fades to changed gains.
void ReferenceLoop::takeGains(double dt) noexcept {
  if (joint_gain_ != nullptr) gain_ = joint_gain_->step(dt);
  if (position_gain_ == nullptr) return;
  const double rotation = rotation_gain_->step(dt);
  ik_->setGains(position_gain_->step(dt), rotation, correction_speed_->step(dt));
  if (second_task_) second_task_->setGain(rotation);
}

void ReferenceLoop::resolve(const CycleInput& input, References& references) noexcept {
  takeGains(input.dt);
  correction_ = PoseCorrection::between(pose_, references.states.view<7>(references.pose));
  switch (reference_.space) {
    case Space::Rest:
      ik_result_.scale = 1.0;
      hold_.resolve(
          input, references,
          [&](const ChainState& state, const JointVector& q, const CartesianReference& to) {
            ik_->solve(state, q, to, ik_result_);
            return ik_result_.velocity;
          });
      break;
    case Space::Joint:
      resolveJoints(input, references);
      break;
    case Space::Pose:
      resolvePose(input, references);
      break;
  }
}

void ReferenceLoop::resolveJoints(const CycleInput& input, References& references) noexcept {
  ik_result_.scale = 1.0;
  const JointVector error = references.states.view<kMaxJoints>(references.joint_position) -
                            input.robot.position - blend_.joints();
  blend_.advance(input.dt);
  references.states.view<kMaxJoints>(references.joint_velocity) += gain_ * error;
}

void ReferenceLoop::resolvePose(const CycleInput& input, References& references) noexcept {
  const auto pose = references.states.view<7>(references.pose);
  const auto twist = references.states.view<6>(references.twist);
  CartesianReference to = reference_.tool;
  to.pose.position = pose.head<3>();
  to.pose.orientation = Quaternion(pose[6], pose[3], pose[4], pose[5]);
  to.velocity = twist.head<3>();
  to.angular_velocity = twist.tail<3>();
  ChainState chain = input.chain;
  chain.tool.position += blend_.position();
  chain.tool.orientation = expRotation(blend_.rotation()) * chain.tool.orientation;
  blend_.advance(input.dt);
  if (second_task_) {
    ik_->solve(chain, input.robot.position, to, *second_task_, ik_result_);
  } else {
    ik_->solve(chain, input.robot.position, to, ik_result_);
  }
  references.states.view<kMaxJoints>(references.joint_velocity) =
      reference_.share * ik_result_.velocity;
}

SetPoint ReferenceLoop::setPoint(const CycleInput& input, bool at_rest) const noexcept {
  const double rate = std::max(input.time_scale, 0.1);
  const RobotSample& robot = input.robot;
  SetPoint from;
  from.joints = robot.commanded_position;
  from.joint_velocity = robot.commanded_velocity / rate;
  if (reference_.space == Space::Joint) {
    from.joints = reference_.joint_next;
    from.joint_velocity = reference_.joint_velocity / rate;
  }
  ChainState state;
  robot_->chain.evaluate(from.joints, state);
  const Eigen::Matrix<double, 6, 1> twist = state.jacobian * from.joint_velocity;
  from.pose = reference_.space == Space::Rest ? correction_.outOf(state.tool) : state.tool;
  from.velocity = twist.head<3>();
  from.angular_velocity = twist.tail<3>();
  if (reference_.space == Space::Pose) {
    from.pose = reference_.nextTool();
    from.velocity = reference_.tool.velocity / rate;
    from.angular_velocity = reference_.tool.angular_velocity / rate;
  }
  if (at_rest && reference_.space != Space::Rest) {
    from.joint_velocity.setZero();
    from.velocity.setZero();
    from.angular_velocity.setZero();
  }
  return from;
}

double ReferenceLoop::error(const CycleInput& input) const noexcept {
  switch (reference_.space) {
    case Space::Joint:
      return (reference_.joint_next - input.robot.position).lpNorm<Eigen::Infinity>();
    case Space::Pose:
      return ik_result_.position_error.norm();
    case Space::Rest:
      break;
  }
  return 0.0;
}

double ReferenceLoop::allowedError() const noexcept {
  return reference_.space == Space::Joint ? tolerance_ : arrive_distance_;
}

Reason ReferenceLoop::stuck(const CycleInput& input) const noexcept {
  if (reference_.space == Space::Pose) return Arrival::handStuck(error(input));
  return Reason(ReasonCode::TargetNotReached, "the arm does not reach the target: is it blocked?");
}

}  // namespace coglab_controllers
