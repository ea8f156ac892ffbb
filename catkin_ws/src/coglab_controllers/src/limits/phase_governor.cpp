#include "coglab_controllers/limits/phase_governor.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

PhaseGovernor::PhaseGovernor(double rise, double fall) : rise_(rise), fall_(fall) {
  if (!(std::isfinite(rise) && std::isfinite(fall) && rise > 0.0 && fall > 0.0)) {
    throw std::invalid_argument("phase governor: expected positive rates of change, got " + std::to_string(rise) +
                                " and " + std::to_string(fall));
  }
}

double PhaseGovernor::update(double dt, double speed_scale, double limit_scale) noexcept {
  const double wanted = std::clamp(speed_scale, 0.0, 1.0);
  // A limit that scaled the last cycle's velocity asks for a clock as much slower than it was.
  const double bearable = limit_scale < 1.0 ? rate_ * std::clamp(limit_scale, 0.0, 1.0) : 1.0;
  const double target = std::min(wanted, bearable);
  rate_ = target > rate_ ? std::min(target, rate_ + rise_ * dt) : std::max(target, rate_ - fall_ * dt);
  return rate_;
}

}  // namespace coglab_controllers
