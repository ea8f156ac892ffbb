#include "coglab_controllers/dmp/motion_end.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

MotionEnd::MotionEnd(const MotionEndParameters& parameters) : parameters_(parameters) {
  const auto require = [](const char* name, double value) {
    if (std::isfinite(value) && value > 0.0) return;
    throw std::invalid_argument(std::string(name) + ": expected a positive number, got " +
                                std::to_string(value));
  };
  require("end_phase", parameters.phase);
  require("end_speed", parameters.speed);
  require("end_turning", parameters.turning);
  require("end_distance", parameters.distance);
  require("follow_distance", parameters.follow_distance);
  require("follow_time", parameters.follow_time);
}

void MotionEnd::reset() noexcept {
  latched_ = false;
  away_ = 0.0;
}

MotionEnd::Event MotionEnd::update(double dt, double phase, double speed, double turning,
                                   const Vector3& position, const Vector3& goal,
                                   const Vector3& raw_goal) noexcept {
  if (!latched_) {
    const MotionEndParameters& p = parameters_;
    if (phase >= p.phase || speed >= p.speed || turning >= p.turning ||
        (position - goal).norm() >= p.distance || (goal - raw_goal).norm() >= p.follow_distance) {
      return Event::None;
    }
    latch(goal);
    return Event::Ended;
  }
  away_ = (raw_goal - goal_).norm() > parameters_.follow_distance ? away_ + dt : 0.0;
  if (away_ < parameters_.follow_time) return Event::None;
  reset();
  return Event::FollowsAgain;
}

}  // namespace coglab_controllers
