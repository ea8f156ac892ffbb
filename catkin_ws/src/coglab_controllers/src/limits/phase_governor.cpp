#include "coglab_controllers/limits/phase_governor.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

PhaseGovernor::PhaseGovernor(double rise, double fall) : rise_(rise), fall_(fall) {
  if (!(std::isfinite(rise) && std::isfinite(fall) && rise > 0.0 && fall > 0.0)) {
    throw std::invalid_argument("phase governor: expected positive rates of change, got " +
                                std::to_string(rise) + " and " + std::to_string(fall));
  }
}

double PhaseGovernor::update(double dt, double speed_scale, double limit_scale) noexcept {
  const double last = rate_;
  const double wanted = std::clamp(speed_scale, 0.0, 1.0);
  rate_ =
      wanted > rate_ ? std::min(wanted, rate_ + rise_ * dt) : std::max(wanted, rate_ - fall_ * dt);
  // The arm already moves that much slower than the motion, so the clock follows at once: no step
  // in velocity.
  if (limit_scale < 1.0) rate_ = std::min(rate_, last * std::clamp(limit_scale, 0.0, 1.0));
  return rate_;
}

}  // namespace coglab_controllers
