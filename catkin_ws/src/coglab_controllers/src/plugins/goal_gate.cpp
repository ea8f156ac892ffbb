#include "coglab_controllers/plugins/goal_gate.hpp"

namespace coglab_controllers {

void GoalGate::reset(const GoalObservation& first) noexcept {
  goal_ = first;
  candidate_ = first;
  last_ = first;
  agreeing_ = 0;
  believed_ns_ = first.stamp_ns;
  age_ = 0.0;
  jump_ = 0.0;
  state_ = State::Fresh;
}

bool GoalGate::isNew(const GoalObservation& newest) const noexcept {
  if (newest.frame_ns != 0) return newest.frame_ns > last_.frame_ns;
  return newest.position != last_.position ||
         newest.orientation.coeffs() != last_.orientation.coeffs();
}

GoalGate::State GoalGate::update(std::int64_t now_ns, const GoalObservation& newest) noexcept {
  if (isNew(newest)) {
    last_ = newest;
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
  if (newest.frame_ns == 0) last_.stamp_ns = newest.stamp_ns;
  age_ = 1e-9 * static_cast<double>(now_ns - last_.stamp_ns);
  if (agreeing_ == 0) believed_ns_ = last_.stamp_ns;
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
