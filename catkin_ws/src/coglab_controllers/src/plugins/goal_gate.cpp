#include "coglab_controllers/plugins/goal_gate.hpp"

namespace coglab_controllers {

void GoalGate::reset(const GoalObservation& first) noexcept {
  goal_ = first;
  candidate_ = first;
  agreeing_ = 0;
  last_stamp_ns_ = first.stamp_ns;
  believed_ns_ = first.stamp_ns;
  age_ = 0.0;
  jump_ = 0.0;
  state_ = State::Fresh;
}

GoalGate::State GoalGate::update(std::int64_t now_ns, const GoalObservation& newest) noexcept {
  if (newest.stamp_ns > last_stamp_ns_) {  // each frame is judged once
    last_stamp_ns_ = newest.stamp_ns;
    jump_ = (newest.position - goal_.position).norm();
    if (jump_ <= parameters_.max_jump) {
      goal_ = newest;
      agreeing_ = 0;
    } else {
      const bool agrees =
          agreeing_ > 0 && (newest.position - candidate_.position).norm() <= parameters_.agreement;
      agreeing_ = agrees ? agreeing_ + 1 : 1;
      candidate_ = newest;
      if (agreeing_ >= parameters_.frames_to_accept) {
        goal_ = newest;
        agreeing_ = 0;
      }
    }
  }
  age_ = 1e-9 * static_cast<double>(now_ns - last_stamp_ns_);
  if (agreeing_ == 0) believed_ns_ = last_stamp_ns_;
  const double held = 1e-9 * static_cast<double>(now_ns - believed_ns_);
  if (parameters_.max_age <= 0.0) {
    state_ = agreeing_ > 0 ? State::Jumped : State::Fresh;
  } else if (parameters_.lost_time > 0.0 && held > parameters_.lost_time) {
    state_ = State::Lost;
  } else if (age_ > parameters_.max_age) {
    state_ = State::Old;
  } else {
    state_ = agreeing_ > 0 ? State::Jumped : State::Fresh;
  }
  return state_;
}

}  // namespace coglab_controllers
