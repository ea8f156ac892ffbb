#include "lwr_fri_bridge/motion/velocity_filter.hpp"

#include <cmath>

namespace lwr_fri_bridge {

double VelocityFilter::weight(double time_constant, double dt, std::uint32_t cycles) {
  return time_constant > 0.0 ? -std::expm1(-dt * cycles / time_constant) : 1.0;
}

const Vector7& VelocityFilter::update(const Vector7& position, std::uint32_t cycles, double dt) {
  if (!primed_) {
    velocity_.setZero();
    primed_ = true;
  } else {
    const Vector7 mean = (position - last_) / (dt * cycles);
    velocity_ += weight(time_constant_, dt, cycles) * (mean - velocity_);
  }
  last_ = position;
  return velocity_;
}

double VelocityFilter::delay(double time_constant, double dt) {
  const double k = weight(time_constant, dt, 1);
  return 0.5 * dt + dt * (1.0 - k) / k;
}

double VelocityFilter::noiseGain(double time_constant, double dt) {
  const double k = weight(time_constant, dt, 1);
  return k / dt * std::sqrt(2.0 / (2.0 - k));
}

}  // namespace lwr_fri_bridge
