#include "coglab_controllers/goal/goal_limits.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_controllers {

const char* GoalBounds::wrong() const noexcept {
  if (!region_low.allFinite() || !region_high.allFinite() || !std::isfinite(retreat) ||
      !std::isfinite(drop)) {
    return "goal_region_low, goal_region_high, goal_retreat or goal_drop is not finite";
  }
  if ((region_high - region_low).minCoeff() < 0.0) {
    return "goal_region_low is above goal_region_high in x, y or z";
  }
  if (retreat < 0.0 || drop < 0.0) {
    return "goal_retreat or goal_drop is negative; expected a distance in m, or 0 for none";
  }
  return "";
}

void GoalLimits::begin(const GoalObservation& first, const Vector3& hand,
                       const GoalBounds& bounds) noexcept {
  bounds_ = bounds;
  hand_ = hand;
  nearest_ = (first.position - hand).norm();
  height_ = first.position.z();
  was_inside_ = false;
  candidate_ = first;
  last_ = first;
  seen_ = true;
  believe(first);
  arm_ns_ = -1;
  age_ns_ = held_ns_ = 0;
  jump_ = 0.0;
  state_ = State::Fresh;
}

void GoalLimits::believe(const GoalObservation& newest) noexcept {
  goal_ = newest;
  agreeing_ = 0;
  settled_ = true;
}

bool GoalLimits::isNew(const GoalObservation& newest) const noexcept {
  if (!seen_) return true;
  if (newest.frame_ns != 0) return newest.isLaterThan(last_);
  return newest.position != last_.position ||
         newest.orientation.coeffs() != last_.orientation.coeffs();
}

void GoalLimits::judge(const GoalObservation& newest) noexcept {
  last_ = newest;
  seen_ = true;
  const bool is_static = newest.frame_ns == 0;
  if (!settled_ && is_static) {
    believe(newest);
    return;
  }
  jump_ = settled_ ? (newest.position - goal_.position).norm() : 0.0;
  if (settled_ && jump_ <= frames_.max_jump) {
    believe(newest);
    return;
  }
  const bool agrees =
      agreeing_ > 0 && (newest.position - candidate_.position).norm() <= frames_.agreement;
  agreeing_ = agrees ? agreeing_ + 1 : 1;
  candidate_ = newest;
  if (agreeing_ >= frames_.frames_to_accept) believe(newest);
}

/// Adds a cycle to the ages. Only an arrival compares two clocks: stamps know nothing of the arm's.
void GoalLimits::grow(std::int64_t now_ns, bool arrived, std::int64_t arm_ns) noexcept {
  const bool first = arm_ns_ < 0;
  const std::int64_t passed = first ? 0 : std::max<std::int64_t>(0, arm_ns - arm_ns_);
  arm_ns_ = arm_ns;
  held_ns_ = first ? now_ns - goal_.stamp_ns : held_ns_ + passed;
  age_ns_ = first || arrived ? now_ns - last_.stamp_ns : age_ns_ + passed;
  if (agreeing_ == 0) held_ns_ = age_ns_;
}

GoalLimits::State GoalLimits::update(std::int64_t now_ns, const GoalObservation& newest,
                                     std::int64_t arm_ns) noexcept {
  bool arrived = isNew(newest);
  if (arrived) judge(newest);
  if (newest.frame_ns == 0 && newest.stamp_ns != last_.stamp_ns) {
    last_.stamp_ns = newest.stamp_ns;
    arrived = true;
  }
  grow(now_ns, arrived, arm_ns);
  const State seen = agreeing_ > 0 ? State::Jumped : State::Fresh;
  if (!settled_) {
    state_ = State::Unsettled;
  } else if (frames_.max_age <= 0.0) {
    state_ = seen;
  } else if (frames_.lost_time > 0.0 && seconds(held_ns_) > frames_.lost_time) {
    state_ = State::Lost;
  } else {
    state_ = age() > frames_.max_age ? State::Old : seen;
  }
  return state_;
}

bool GoalLimits::outside(const Vector3& goal) const noexcept {
  return (goal - bounds_.region_high).maxCoeff() > 0.0 ||
         (bounds_.region_low - goal).maxCoeff() > 0.0;
}

Reason GoalLimits::checkBounds(double dt, const Vector3& goal) noexcept {
  const double below = height_ - goal.z();
  height_ += (1.0 - std::exp(-dt / kDropTime)) * (goal.z() - height_);
  if (bounds_.drop > 0.0 && below > bounds_.drop) {
    return Reason(ReasonCode::GoalFell, "the goal falls: it is ")
           << below << " m below where it just was; the reach ends";
  }
  const double distance = (goal - hand_).norm();
  nearest_ = std::min(nearest_, distance);
  if (bounds_.retreat > 0.0 && distance > nearest_ + bounds_.retreat) {
    return Reason(ReasonCode::GoalWithdrawn, "the goal went back by ")
           << distance - nearest_ << " m; the reach ends";
  }
  if (bounds_.region_low == bounds_.region_high) return {};
  if (!outside(goal)) was_inside_ = true;
  if (!was_inside_ || !outside(goal)) return {};
  return Reason(ReasonCode::GoalLeftRegion, "the goal has left its region: it is at (")
         << goal.x() << ", " << goal.y() << ", " << goal.z() << ") m; the reach ends";
}

}  // namespace coglab_controllers
