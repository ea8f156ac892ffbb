#include "lwr_fri_bridge/supervision/supervisor.hpp"

namespace lwr_fri_bridge {

const char* nameOf(SupervisorState state) {
  switch (state) {
    case SupervisorState::Disconnected:
      return "disconnected";
    case SupervisorState::Monitor:
      return "monitor";
    case SupervisorState::Starting:
      return "starting";
    case SupervisorState::Command:
      return "command";
    case SupervisorState::Holding:
      return "holding";
    case SupervisorState::Stopping:
      return "stopping";
    case SupervisorState::Stopped:
      return "stopped";
  }
  return "?";
}

void Supervisor::startBegins() {
  starting_ = true;
  fell_back_ = false;
  stopped_by_ = MotionBlock::NotStarted;
}

void Supervisor::startEnds(bool reached) {
  starting_ = false;
  started_ = reached;
}

void Supervisor::stopBegins() {
  stopping_ = true;
  at_rest_ = false;
  starting_ = false;
}

void Supervisor::stopEnds() {
  stopping_ = false;
  started_ = false;
  fell_back_ = false;
  stopped_by_ = MotionBlock::NotStarted;
}

MotionBlock Supervisor::judge(const SupervisorInput& input) const {
  if (!input.connected) return MotionBlock::Disconnected;
  if (stopping_) return MotionBlock::Stopping;
  if (held_ || braking_) return MotionBlock::Held;
  if (!input.command_mode) return MotionBlock::Monitor;
  if (input.drive_error) return MotionBlock::DriveError;
  if (input.quality_unacceptable) return MotionBlock::PoorQuality;
  if (!input.full_power) return MotionBlock::NoPower;
  if (!started_) return stopped_by_;
  if (input.leashed) return MotionBlock::Leashed;
  return MotionBlock::None;
}

void Supervisor::update(const SupervisorInput& input) {
  const bool commanded = input.connected && input.command_mode && input.full_power;
  const bool commanding = commanded && !input.quality_unacceptable && !input.drive_error;
  if (started_ && (!commanding || input.fresh_session)) {
    started_ = false;
    if (input.quality_unacceptable) stopped_by_ = MotionBlock::PoorQuality;
    if (input.drive_error) stopped_by_ = MotionBlock::DriveError;
    if (!stopping_) {
      fell_back_ = true;
      ++fall_backs_;
    }
  }
  at_rest_ = input.stands_still || !commanded;

  const MotionBlock block = judge(input);
  // Every change of the permission starts a new epoch. Commands from before it are ignored.
  if ((block == MotionBlock::None) != (block_ == MotionBlock::None)) ++epoch_;
  block_ = block;
  if (at_rest_) braking_ = false;

  if (!input.connected) {
    state_ = SupervisorState::Disconnected;
  } else if (stopping_) {
    state_ = SupervisorState::Stopping;
  } else if (starting_) {
    state_ = SupervisorState::Starting;
  } else if (held_ || block_ == MotionBlock::Held) {
    state_ = SupervisorState::Holding;
  } else if (started_) {
    state_ = SupervisorState::Command;
  } else if (fell_back_ || input.command_mode) {
    state_ = SupervisorState::Stopped;
  } else {
    state_ = SupervisorState::Monitor;
  }
}

}  // namespace lwr_fri_bridge
