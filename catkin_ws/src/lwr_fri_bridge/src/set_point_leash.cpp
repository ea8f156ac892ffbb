#include "lwr_fri_bridge/set_point_leash.hpp"

#include <algorithm>
#include <cmath>

#include "lwr_fri_bridge/braking.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kReturnSpeed = 0.3;   // rad/s: a blocked arm is relaxed within about a second
constexpr double kReturnDelay = 0.05;  // s, time constant of the last bit of the return
constexpr double kReturned = 1e-3;     // rad
constexpr double kNoticeable = 0.1;    // of the leash: joints ahead by less keep their set-point

}  // namespace

bool SetPointLeash::update(const Interpolator& interpolator, const Vector7& measured,
                           const Vector7& wanted, double leash, const JointLimits& limits,
                           Vector7& target) {
  const Vector7 ahead = interpolator.position() - measured;
  if (joint_ < 0) {
    for (int i = 0; i < 7; ++i) {
      const bool outward =
          interpolator.velocity()[i] * ahead[i] > 0.0 || target[i] * ahead[i] > 0.0;
      if (outward && std::abs(ahead[i]) > leash) joint_ = i;
    }
    if (joint_ < 0) return false;
    home_ = measured;
    for (int i = 0; i < 7; ++i) {
      direction_[i] = std::abs(ahead[i]) > kNoticeable * leash ? std::copysign(1.0, ahead[i]) : 0.0;
    }
  }

  bool returned = true, still_wanted = false;
  for (int i = 0; i < 7; ++i) {
    target[i] = 0.0;
    if (direction_[i] == 0.0) continue;
    const double distance = home_[i] - interpolator.position()[i];
    const double speed =
        brakingSpeed(std::abs(distance), limits.acceleration[i], limits.jerk[i], kReturnDelay);
    target[i] = std::copysign(std::min({speed, kReturnSpeed, limits.velocity[i]}), distance);
    returned = returned && std::abs(distance) < kReturned;
    still_wanted = still_wanted || wanted[i] * direction_[i] > 0.0;
  }
  if (returned && !still_wanted) joint_ = -1;
  return joint_ >= 0;
}

}  // namespace lwr_fri_bridge
