#include "coglab_controllers/goal/goal_gate.hpp"

namespace coglab_controllers {

void GoalGate::reset(const GoalObservation& first) noexcept {
  candidate_ = first;
  last_ = first;
  seen_ = true;
  believe(first);
  believed_ns_ = first.stamp_ns;
  age_ = 0.0;
  jump_ = 0.0;
  state_ = State::Fresh;
}

void GoalGate::believe(const GoalObservation& newest) noexcept {
  goal_ = newest;
  agreeing_ = 0;
  settled_ = true;
}

bool GoalGate::isNew(const GoalObservation& newest) const noexcept {
  if (!seen_) return true;
  if (newest.frame_ns != 0) return newest.isLaterThan(last_);
  return newest.position != last_.position ||
         newest.orientation.coeffs() != last_.orientation.coeffs();
}

void GoalGate::judge(const GoalObservation& newest) noexcept {
  last_ = newest;
  seen_ = true;
  const bool is_static = newest.frame_ns == 0;
  if (!settled_ && is_static) {
    believe(newest);
    return;
  }
  jump_ = settled_ ? (newest.position - goal_.position).norm() : 0.0;
  if (settled_ && jump_ <= parameters_.max_jump) {
    believe(newest);
    return;
  }
  const bool agrees =
      agreeing_ > 0 && (newest.position - candidate_.position).norm() <= parameters_.agreement;
  agreeing_ = agrees ? agreeing_ + 1 : 1;
  candidate_ = newest;
  if (agreeing_ >= parameters_.frames_to_accept) believe(newest);
}

GoalGate::State GoalGate::update(std::int64_t now_ns, const GoalObservation& newest) noexcept {
  if (isNew(newest)) judge(newest);
  if (newest.frame_ns == 0) last_.stamp_ns = newest.stamp_ns;
  age_ = 1e-9 * static_cast<double>(now_ns - last_.stamp_ns);
  if (agreeing_ == 0) believed_ns_ = last_.stamp_ns;
  const double held = 1e-9 * static_cast<double>(now_ns - believed_ns_);
  const State seen = agreeing_ > 0 ? State::Jumped : State::Fresh;
  if (!settled_) {
    state_ = State::Unsettled;
  } else if (parameters_.max_age <= 0.0) {
    state_ = seen;
  } else if (parameters_.lost_time > 0.0 && held > parameters_.lost_time) {
    state_ = State::Lost;
  } else {
    state_ = age_ > parameters_.max_age ? State::Old : seen;
  }
  return state_;
}

}  // namespace coglab_controllers
