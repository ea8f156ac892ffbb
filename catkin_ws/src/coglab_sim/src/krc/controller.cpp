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
#define KRC(type, field, value, name, low, high, ...) \
  requireFieldWithin({low, high}, name, p.field);
#include "coglab_sim/parameter_table.inc"
  if (!(p.quality_bad <= p.quality_ok && p.quality_ok <= p.quality_perfect)) {
    throw std::invalid_argument(
        "parameters krc/quality_bad, krc/quality_ok, krc/quality_perfect: expected rising values");
  }
  return p;
}

constexpr std::size_t kMessageWindow = 200;

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

  // A fall-back or a change of strategy has reset the set-point, so that there is no start to
  // interpolate from.
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
        true;  // the PC mirrors the position while the drives are off and enters again afterwards
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
    // Cartesian impedance without joint command: the joint set-point follows the arm.
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
  // Measurements after friClose still report monitor mode: OFF is never sent.
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
    const int source = row < 3 ? row : 8 - row;  // the wire's order of rotations is z y x
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
  lingers_until_ = time_;  // the program was cancelled before its end
  parameters_.period = period;
  program_ = makeKrlProgram(parameters_.convention);
  krl_out_ = {};
  opens_at_ = time_ + pause;
}

// --------------------------------------------------------------------------------------------------------------
// interface of the KRL program

void Controller::setToBool(int index, bool value) {
  const auto bit = static_cast<std::uint16_t>(1U << (index - 1));
  krl_out_.bools = static_cast<std::uint16_t>(value ? krl_out_.bools | bit : krl_out_.bools & ~bit);
}

bool Controller::setKrlStrategy(int strategy) {
  if (strategy != 10 && strategy != 20 && strategy != 30) {
    show("$STIFFNESS.STRATEGY " + std::to_string(strategy) + " unknown, expected 10, 20 or 30");
    return false;
  }
  if (state_ == FriState::Command) {
    show("$STIFFNESS.STRATEGY cannot change in command mode");
    return false;
  }
  strategy_ = static_cast<ControlStrategy>(strategy / 10);
  return true;
}

void Controller::friOpen(double period) {
  if (state_ != FriState::Off) return;
  if (period > 0.0) {
    if (!rangeOf("krc/period").holds(period)) {
      show("friOpen: period " + std::to_string(period) + " s is not in 0.001 .. 0.1");
      return;
    }
    parameters_.period = period;
  }
  state_ = FriState::Monitor;
  statistics_.clear();
  measured_once_ = false;
}

FriState Controller::friStart(double scale) {
  if (state_ != FriState::Monitor) return state_;
  start_scale_ = std::fmin(std::fmax(scale, 0.0), 1.0);
  if (power() != fri::kAllDrivesOn) {
    show("friStart: drives not ready");
  } else if (static_cast<int>(statistics_.quality()) < parameters_.entry_quality) {
    show(std::string("friStart: quality too low, answer rate ") +
         std::to_string(statistics_.answerRate()));
  } else if (!answered_) {
    show("friStart: no answer in time");
  } else if (const std::string fault = checkEntry(checkContext(), answer_); !fault.empty()) {
    leaveCommandMode(fault);
  } else {
    state_ = FriState::Command;
    flags_ = answer_.flags;
    missed_in_row_ = 0;
    entry_pending_ = false;
    follow(answer_);
    last_step_.setZero();
  }
  return state_;
}

void Controller::friStop() {
  if (state_ == FriState::Command) state_ = FriState::Monitor;
  last_step_.setZero();
}

void Controller::friClose() {
  if (state_ == FriState::Off) return;
  friStop();
  state_ = FriState::Off;
  lingers_until_ = time_ + parameters_.close_linger;
}

void Controller::setJointImpedance(const Vector7& stiffness, const Vector7& damping) {
  joint_stiffness_ = stiffness.cwiseMax(0.0).cwiseMin(parameters_.joint_stiffness_max);
  joint_damping_ = damping.cwiseMax(0.0).cwiseMin(1.0);
}

void Controller::setCartesianImpedance(const Vector6& stiffness, const Vector6& damping) {
  frame_stiffness_.head<3>() =
      stiffness.head<3>().cwiseMax(0.0).cwiseMin(parameters_.frame_stiffness_max);
  frame_stiffness_.tail<3>() =
      stiffness.tail<3>().cwiseMax(0.0).cwiseMin(parameters_.rotation_stiffness_max);
  frame_damping_ = damping.cwiseMax(0.0).cwiseMin(1.0);
}

void Controller::nudge() {
  if (error_latched_) {
    if (!parameters_.acknowledge_by_program) {
      show("acknowledgement required");
      return;
    }
    acknowledge();
  }
  if (drives_on_ || drives_on_at_ >= 0.0) return;
  drives_on_at_ = time_ + parameters_.power_up + parameters_.brake_release;
}

void Controller::show(const std::string& message) {
  messages_.push_back({time_, message});
  if (messages_.size() > kMessageWindow) messages_.pop_front();
  ++message_count_;
}

}  // namespace coglab_sim::krc
