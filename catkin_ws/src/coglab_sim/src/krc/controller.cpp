#include "coglab_sim/krc/controller.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_sim/ranges.hpp"

namespace coglab_sim::krc {

namespace fri = lwr_fri_bridge::fri;
using fri::ControlStrategy;
using fri::FriState;

namespace {

const Parameters& checked(const Parameters& p) {
  requireWithin("krc/period", p.period);
  requireWithin("krc/quality_perfect", p.quality_perfect);
  requireWithin("krc/quality_ok", p.quality_ok);
  requireWithin("krc/quality_bad", p.quality_bad);
  requireWithin("krc/entry_quality", p.entry_quality);
  requireWithin("krc/extrapolated_packets", p.extrapolated_packets);
  requireWithin("krc/speed_margin", p.speed_margin);
  requireWithin("krc/krl_poll", p.krl_poll);
  requireWithin("krc/krl_drive_wait", p.krl_drive_wait);
  requireWithin("krc/krl_quality_wait", p.krl_quality_wait);
  requireWithin("krc/frame_speed_limit", p.frame_speed_limit);
  requireWithin("krc/frame_turn_limit", p.frame_turn_limit);
  requireWithin("krc/frame_orthonormality", p.frame_orthonormality);
  requireWithin("krc/close_linger", p.close_linger);
  requireWithin("krc/drive_heating_time", p.drive_heating_time);
  if (!(p.quality_bad <= p.quality_ok && p.quality_ok <= p.quality_perfect)) {
    throw std::invalid_argument(
        "parameters krc/quality_bad, krc/quality_ok, krc/quality_perfect: expected rising values");
  }
  return p;
}

}  // namespace

Controller::Controller(const Parameters& parameters, const ServoParameters& servos,
                       const Vector7& position)
    : parameters_(checked(parameters)),
      servo_parameters_(servos),
      statistics_(parameters_),
      program_(makeKrlProgram(parameters.convention)),
      joint_stiffness_(Vector7::Constant(parameters.joint_stiffness)),
      joint_damping_(Vector7::Constant(parameters.damping)),
      frame_damping_(Vector6::Constant(parameters.damping)),
      own_(position),
      temperature_(Vector7::Constant(parameters.ambient_temperature)) {
  frame_stiffness_ << Vector3d::Constant(parameters.frame_stiffness),
      Vector3d::Constant(parameters.rotation_stiffness);
}

// ----------------------------------------------------------------------------------------------------------------
// wire

void Controller::receive(const std::uint8_t* bytes, std::size_t size, double latency) {
  fri::CommandDatagram command;
  if (!fri::decode(bytes, size, command)) {
    ++rejections_.wrong_size;
    return;
  }
  if (command.header.id != fri::kCommandId || command.header.size != fri::kCommandSize) {
    ++rejections_.wrong_header;
    return;
  }
  if (!measured_once_ || command.header.reflected != counter_) {
    ++rejections_.stale;
    return;
  }
  if (answered_ || (peer_known_ && command.header.counter == peer_counter_)) {
    ++rejections_.repeated;
    return;
  }
  peer_known_ = true;
  peer_counter_ = command.header.counter;
  answered_ = true;
  answer_latency_ = latency;
  answer_ = command;
  krl_in_ = command.krl;
}

PeriodCommand Controller::tick(const Servos& arm, bool on_time) {
  PeriodCommand period;
  updateDrives(arm);
  watchTorque(arm);
  if (brakesWanted()) holdMeasured(arm);
  period.from = setPoint();
  period.frame_from = frame_;

  const bool expected = sends() && measured_once_;
  if (expected) judgeAnswer(arm, on_time);
  if (time_ >= krl_due_ && time_ >= opens_at_) krl_due_ = time_ + program_->poll(*this);
  answered_ = false;

  // After a fall-back or a change of strategy the set-point was re-anchored: nothing to interpolate
  // from.
  if (brakesWanted()) period.from = setPoint();
  period.to = setPoint();
  period.frame_to = frame_;
  period.servo = servoCommand();
  time_ += parameters_.period;
  return period;
}

void Controller::judgeAnswer(const Servos& arm, bool on_time) {
  if (answered_ || on_time) statistics_.add(answered_, answer_latency_);
  if (state_ != FriState::Command) return;

  if (statistics_.quality() == fri::Quality::Unacceptable) {
    leaveCommandMode("FRI quality unacceptable");
    return;
  }
  if (power() != fri::kAllDrivesOn) {
    entry_pending_ =
        true;  // the PC mirrors while the drives are off and enters anew when they return
    missed_in_row_ = 0;
    return;
  }
  if (!answered_) {
    if (on_time) ++missed_in_row_;
    if (missed_in_row_ > parameters_.extrapolated_packets) {
      leaveCommandMode("FRI timing: " + std::to_string(missed_in_row_) +
                       " successive answers missing");
    } else if (!entry_pending_) {
      extrapolate();
    }
    return;
  }
  missed_in_row_ = 0;
  const bool commands_joints = !entry_pending_ && (answer_.flags & fri::kJointPosition) != 0;
  if (commands_joints &&
      jointPastLimitSwitch(parameters_, fri::jointsFromWire(answer_.joint_position)) >= 0) {
    ++limit_switches_;
  }
  const std::string fault =
      entry_pending_ ? checkEntry(checkContext(), answer_) : checkCyclic(checkContext(), answer_);
  if (!fault.empty()) {
    leaveCommandMode(fault);
    return;
  }
  entry_pending_ = false;
  follow(answer_);
  if ((flags_ & fri::kJointPosition) == 0) {
    // Cartesian impedance without joint command: the joint set-point goes where the arm goes.
    offset_ = arm.position() - own_;
    last_step_.setZero();
  }
}

CheckContext Controller::checkContext() const {
  Vector7 speed = parameters_.speed_limit;
  if (parameters_.mode == OperatingMode::T1) speed = speed.cwiseMin(parameters_.t1_speed_limit);
  const bool torque_in_force = state_ == FriState::Command && (flags_ & fri::kJointTorque) != 0;
  return {parameters_,
          strategy_,
          setPoint(),
          frame_,
          torque_in_force ? fri::jointsFromWire(latched_.joint_torque) : Vector7(Vector7::Zero()),
          speed * start_scale_,
          flags_};
}

void Controller::follow(const fri::CommandDatagram& command) {
  if ((command.flags & fri::kJointPosition) != 0) {
    const Vector7 next = fri::jointsFromWire(command.joint_position);
    last_step_ = next - setPoint();
    offset_ = next - own_;
  }
  if ((command.flags & fri::kCartesianPosition) != 0)
    poseFromWire(command.cartesian_frame, parameters_.frame_orthonormality, frame_);
  latched_ = command;
}

void Controller::extrapolate() {
  const Vector7 next = setPoint() + last_step_;
  const int joint = jointPastLimitSwitch(parameters_, next);
  if (joint >= 0 && !last_step_.isZero()) {
    ++limit_switches_;
    leaveCommandMode(limitSwitchMessage(joint));
    return;
  }
  offset_ = next - own_;
}

fri::MeasurementDatagram Controller::measure(const Servos& arm, const ArmSignals& signals) {
  fri::MeasurementDatagram m{};
  m.header = fri::measurementHeader(++counter_, peer_counter_);
  measured_once_ = true;
  m.krl = krl_out_;
  m.timestamp = static_cast<float>(time_);
  // Measurements that follow friClose still say monitor mode: OFF is never on the wire.
  m.state = static_cast<std::uint16_t>(state_ == FriState::Command ? state_ : FriState::Monitor);
  m.quality = static_cast<std::uint16_t>(statistics_.quality());
  m.measurement_period = m.command_period = static_cast<float>(parameters_.period);
  m.safety_scale = static_cast<float>(start_scale_);
  m.answer_rate = static_cast<float>(statistics_.answerRate());
  m.latency = static_cast<float>(statistics_.latency());
  m.jitter = static_cast<float>(statistics_.jitter());
  m.miss_rate = static_cast<float>(statistics_.missRate());
  m.miss_counter = statistics_.missCounter();
  m.power = power();
  m.control = static_cast<std::uint16_t>(strategy_);
  m.drive_error = drive_error_;
  m.drive_warning = 0;
  for (int i = 0; i < 7; ++i) {
    if (temperature_[i] > parameters_.drive_warning)
      m.drive_warning = static_cast<std::uint16_t>(m.drive_warning | (1U << i));
  }
  fri::jointsToWire(temperature_, m.temperature);
  fri::jointsToWire(signals.position, m.measured_position);
  poseToWire(arm.terms().tip, m.measured_frame);
  if (strategy_ != ControlStrategy::CartesianImpedance) frame_own_ = frame_ = arm.terms().tip;
  fri::jointsToWire(own_, m.commanded_position);
  fri::jointsToWire(offset_, m.commanded_position_offset);
  poseToWire(frame_own_, m.commanded_frame);
  poseToWire(frame_own_.inverse() * frame_, m.commanded_frame_offset);
  fri::jointsToWire(signals.torque, m.measured_torque);
  fri::jointsToWire(signals.external_torque, m.external_torque);

  // Wrench whose joint torques fit the estimate best: F = (J J^T)^-1 J tau.
  const Matrix67& jacobian = arm.terms().jacobian;
  Eigen::Matrix<double, 6, 6> gram = jacobian * jacobian.transpose();
  gram.diagonal().array() += 1e-4;
  const Vector6 wrench = gram.ldlt().solve(jacobian * signals.external_torque);
  fri::wrenchToWire(wrench, m.external_wrench);

  for (int row = 0; row < 6; ++row) {
    const int source = row < 3 ? row : 8 - row;  // the wire's rotation rows are z y x
    for (int column = 0; column < 7; ++column) {
      m.jacobian[7 * row + column] = static_cast<float>(jacobian(source, column));
    }
  }
  for (int row = 0; row < 7; ++row) {
    for (int column = 0; column < 7; ++column) {
      m.mass_matrix[7 * row + column] = static_cast<float>(arm.terms().mass(row, column));
    }
  }
  fri::jointsToWire(arm.terms().gravity, m.gravity);
  return m;
}

ServoCommand Controller::servoCommand() const {
  const bool active = state_ == FriState::Command;
  const auto given = [&](std::uint32_t flag) { return active && (flags_ & flag) != 0; };
  ServoCommand servo;
  servo.strategy = strategy_;
  servo.stiffness = given(fri::kJointStiffness) ? fri::jointsFromWire(latched_.joint_stiffness)
                                                : joint_stiffness_;
  servo.damping =
      given(fri::kJointDamping) ? fri::jointsFromWire(latched_.joint_damping) : joint_damping_;
  if (given(fri::kJointTorque)) servo.torque = fri::jointsFromWire(latched_.joint_torque);
  servo.frame_stiffness = frame_stiffness_;
  if (given(fri::kCartesianStiffness))
    servo.frame_stiffness = fri::wrenchFromWire(latched_.cartesian_stiffness);
  servo.frame_damping = frame_damping_;
  if (given(fri::kCartesianDamping))
    servo.frame_damping = fri::wrenchFromWire(latched_.cartesian_damping);
  if (given(fri::kCartesianForce)) servo.force = fri::wrenchFromWire(latched_.cartesian_force);
  return servo;
}

// --------------------------------------------------------------------------------------------------------------
// drives

std::uint16_t Controller::power() const {
  return drives_on_ && enabled_ && drive_error_ == 0 ? fri::kAllDrivesOn : 0;
}

void Controller::holdMeasured(const Servos& arm) {
  own_ = arm.position();
  offset_.setZero();
  last_step_.setZero();
  frame_own_ = frame_ = arm.terms().tip;
}

void Controller::updateDrives(const Servos& arm) {
  if (drives_on_at_ >= 0.0 && time_ >= drives_on_at_) {
    drives_on_at_ = -1.0;
    if (enabled_ && drive_error_ == 0) {
      drives_on_ = true;
      holdMeasured(arm);
    } else {
      show("drives not ready");
    }
  }
  // Warm-up of the drives.
  const Vector7 load = arm.motorTorque().cwiseQuotient(servo_parameters_.torque_limit);
  const Vector7 target = Vector7::Constant(parameters_.ambient_temperature) +
                         parameters_.drive_heating * load.cwiseAbs2();
  temperature_ += (target - temperature_) * (parameters_.period / parameters_.drive_heating_time);
}

void Controller::watchTorque(const Servos& arm) {
  if (power() != fri::kAllDrivesOn) {
    saturated_.setZero();
    return;
  }
  for (int i = 0; i < 7; ++i) {
    const bool full = std::abs(arm.motorTorque()[i]) >= 0.999 * servo_parameters_.torque_limit[i];
    saturated_[i] = full ? saturated_[i] + parameters_.period : 0.0;
    if (saturated_[i] > parameters_.torque_limit_time) {
      leaveCommandMode("maximum torque exceeded J" + std::to_string(i + 1));
      return;
    }
  }
}

void Controller::leaveCommandMode(const std::string& reason) {
  show(reason);
  if (state_ == FriState::Command) state_ = FriState::Monitor;
  drives_on_ = false;
  drives_on_at_ = -1.0;
  error_latched_ = true;
  entry_pending_ = false;
  missed_in_row_ = 0;
}

void Controller::setEnablingSwitch(bool pressed) {
  if (pressed != enabled_) {
    const bool gate = parameters_.mode == OperatingMode::Automatic;
    show(std::string(gate ? "operator safety " : "enabling switch ") +
         (pressed ? "closed" : "released"));
  }
  enabled_ = pressed;
}

void Controller::setDriveError(int joint, bool on) {
  if (joint < 0 || joint > 6)
    throw std::invalid_argument("joint " + std::to_string(joint) + ", expected 0 .. 6");
  const auto bit = static_cast<std::uint16_t>(1U << joint);
  drive_error_ = static_cast<std::uint16_t>(on ? drive_error_ | bit : drive_error_ & ~bit);
  if (on) leaveCommandMode("drive error J" + std::to_string(joint + 1));
}

void Controller::setSilent(double duration) { silent_until_ = time_ + duration; }

void Controller::acknowledge() {
  if (error_latched_) show("messages acknowledged");
  error_latched_ = false;
}

void Controller::restartProgram(double period, double pause) {
  requireWithin("krc/period", period);
  if (!(pause >= 0.0)) throw std::invalid_argument("pause must not be negative");
  friClose();
  lingers_until_ = time_;  // the program was cancelled and did not run to its end
  parameters_.period = period;
  program_ = makeKrlProgram(parameters_.convention);
  krl_out_ = {};
  opens_at_ = time_ + pause;
}

}  // namespace coglab_sim::krc
