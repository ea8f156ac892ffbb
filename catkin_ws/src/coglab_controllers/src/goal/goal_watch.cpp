#include "coglab_controllers/goal/goal_watch.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_controllers {

const char* GoalLimits::wrong() const noexcept {
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

void GoalWatch::begin(const GoalLimits& limits, const Vector3& hand, const Vector3& goal) noexcept {
  limits_ = limits;
  hand_ = hand;
  nearest_ = (goal - hand).norm();
  height_ = goal.z();
  was_inside_ = false;
}

bool GoalWatch::outside(const Vector3& goal) const noexcept {
  return (goal - limits_.region_high).maxCoeff() > 0.0 ||
         (limits_.region_low - goal).maxCoeff() > 0.0;
}

Reason GoalWatch::update(double dt, const Vector3& goal) noexcept {
  const double below = height_ - goal.z();
  height_ += (1.0 - std::exp(-dt / kDropTime)) * (goal.z() - height_);
  if (limits_.drop > 0.0 && below > limits_.drop) {
    return Reason(ReasonCode::GoalFell, "the goal falls: it is ")
           << below << " m below where it just was; the reach ends";
  }
  const double distance = (goal - hand_).norm();
  nearest_ = std::min(nearest_, distance);
  if (limits_.retreat > 0.0 && distance > nearest_ + limits_.retreat) {
    return Reason(ReasonCode::GoalWithdrawn, "the goal went back by ")
           << distance - nearest_ << " m; the reach ends";
  }
  if (limits_.region_low == limits_.region_high) return {};
  if (!outside(goal)) was_inside_ = true;
  if (!was_inside_ || !outside(goal)) return {};
  return Reason(ReasonCode::GoalLeftRegion, "the goal has left its region: it is at (")
         << goal.x() << ", " << goal.y() << ", " << goal.z() << ") m; the reach ends";
}

}  // namespace coglab_controllers
