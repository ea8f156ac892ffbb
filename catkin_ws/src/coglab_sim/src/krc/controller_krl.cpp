// The controller as its KRL program sees it.
#include <cmath>

#include "coglab_sim/krc/controller.hpp"

#include "coglab_sim/ranges.hpp"

namespace coglab_sim::krc {

namespace fri = lwr_fri_bridge::fri;
using fri::ControlStrategy;
using fri::FriState;

namespace {
constexpr std::size_t kMessageWindow = 200;
}  // namespace

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
