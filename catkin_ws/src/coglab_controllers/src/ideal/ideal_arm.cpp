#include "coglab_controllers/ideal/ideal_arm.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace coglab_controllers {

using coglab_rt::Answer;
using coglab_rt::MotionBlock;
using coglab_rt::ReasonCode;
using coglab_rt::Vector7;

namespace {

void requireRange(const std::string& name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << "parameter " << name << " = " << value << " is outside its range " << low << ".." << high;
  throw std::invalid_argument(text.str());
}

}  // namespace

void IdealArmConfig::check() const {
  requireRange("period", period, 0.001, 0.1);
  requireRange("command_timeout", command_timeout, 0.005, 1.0);
  for (int joint = 0; joint < 7; ++joint) {
    requireRange("start_position[" + std::to_string(joint) + "]", start_position[joint],
                 limits.lower_position[joint] + limits.position_margin,
                 limits.upper_position[joint] - limits.position_margin);
  }
}

const char* nameOf(IdealArmState state) {
  switch (state) {
    case IdealArmState::Monitor:
      return "monitor";
    case IdealArmState::Command:
      return "command";
    case IdealArmState::Holding:
      return "holding";
    case IdealArmState::Stopping:
      return "stopping";
  }
  return "?";
}

IdealArm::IdealArm(const IdealArmConfig& config)
    : config_((config.check(), config)),
      interpolator_(config.limits),
      braking_(config.limits, config.limits.position_margin) {
  interpolator_.reset(config_.start_position);
  coglab_rt::RobotSample& sample = view_.sample;
  sample.cycle_time = config_.period;
  sample.stop_delay = coglab_rt::lostTime(config_.period);
  sample.stop_rounding = 2.0 * coglab_rt::kWireRounding;
  sample.position = sample.commanded_position = config_.start_position;
  sample.block = MotionBlock::Monitor;
}

void IdealArm::judge() noexcept {
  const std::uint32_t holds = holds_.load(std::memory_order_acquire);
  const bool stands = interpolator_.standsStill();
  brakes_ = (brakes_ || holds != holds_seen_) && !stands;
  holds_seen_ = holds;
  view_.hold_latched = held_.load(std::memory_order_acquire);
  MotionBlock block = MotionBlock::None;
  view_.state = IdealArmState::Command;
  if (view_.hold_latched || brakes_) {
    block = MotionBlock::Held;
    view_.state = IdealArmState::Holding;
  } else if (!started_.load(std::memory_order_acquire)) {
    block = stands ? MotionBlock::Monitor : MotionBlock::Stopping;
    view_.state = stands ? IdealArmState::Monitor : IdealArmState::Stopping;
  }
  coglab_rt::RobotSample& sample = view_.sample;
  if ((block == MotionBlock::None) != (sample.block == MotionBlock::None)) ++sample.motion_epoch;
  sample.block = block;
}

Vector7 IdealArm::targetVelocity(std::int64_t now_ns) noexcept {
  coglab_rt::VelocityCommand newest;
  if (mailboxes_.takeVelocity(newest) && newest.velocity.allFinite()) command_ = newest;
  const double age = 1e-9 * static_cast<double>(now_ns - command_.stamp_ns);
  const bool counts = command_.stamp_ns != 0 && view_.sample.block == MotionBlock::None &&
                      command_.motion_epoch == view_.sample.motion_epoch &&
                      std::abs(age) <= std::max(config_.command_timeout, 2.5 * config_.period);
  if (!counts) return Vector7::Zero();
  // The whole vector is scaled, so that the direction of the motion is kept.
  const double excess =
      (command_.velocity.cwiseAbs().array() / config_.limits.velocity.array()).maxCoeff();
  return excess > 1.0 ? Vector7(command_.velocity / excess) : command_.velocity;
}

void IdealArm::tick(std::int64_t now_ns) noexcept {
  const std::uint32_t requested = requested_.load(std::memory_order_acquire);
  judge();
  Vector7 target = targetVelocity(now_ns);
  braking_.bound(interpolator_, config_.period, target);
  interpolator_.step(target, config_.period);
  coglab_rt::RobotSample& sample = view_.sample;
  ++sample.sequence;
  sample.stamp_ns = now_ns;
  sample.controller_ns += static_cast<std::int64_t>(std::llround(1e9 * config_.period));
  sample.position = sample.commanded_position = interpolator_.position();
  sample.velocity = sample.commanded_velocity = interpolator_.velocity();
  sample.commanded_acceleration = interpolator_.acceleration();
  mailboxes_.publishSample(sample);
  views_.write(view_);
  stands_.store(interpolator_.standsStill(), std::memory_order_release);
  served_.store(requested, std::memory_order_release);
}

Answer IdealArm::request(const std::string& event) {
  const Answer answer = take(event);
  requested_.fetch_add(1, std::memory_order_acq_rel);
  return answer;
}

Answer IdealArm::take(const std::string& event) {
  if (event == "hold") {
    held_.store(true, std::memory_order_release);
    holds_.fetch_add(1, std::memory_order_release);
    return {true, "hold: done"};
  }
  if (event == "reset") {
    const bool was_held = held_.exchange(false, std::memory_order_acq_rel);
    return {true, was_held ? "reset: done" : "reset: nothing to do"};
  }
  if (event == "stop") {
    const bool was_started = started_.exchange(false, std::memory_order_acq_rel);
    return {true, was_started ? "stop: done" : "stop: nothing to do"};
  }
  if (event == "position") return {true, "position: nothing to do, it is the only mode"};
  if (event == "start") {
    if (held_.load(std::memory_order_acquire)) {
      return Answer::refusal(ReasonCode::Held, "start: hold is latched; send reset first");
    }
    const bool was_started = started_.exchange(true, std::memory_order_acq_rel);
    return {true, was_started ? "start: nothing to do" : "start: done"};
  }
  if (event.rfind("joint_impedance", 0) == 0 || event.rfind("cartesian_impedance", 0) == 0) {
    return Answer::refusal(ReasonCode::NotSupported,
                           "'" + event +
                               "': an ideal arm knows no forces; use position, or an arm with "
                               "physics (arm:=fri)");
  }
  return Answer::refusal(
      ReasonCode::InvalidArgument,
      "unknown event '" + event + "'; expected one of: start, stop, hold, reset, position");
}

}  // namespace coglab_controllers
