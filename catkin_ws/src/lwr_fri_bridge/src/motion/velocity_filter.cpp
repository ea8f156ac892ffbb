#include "lwr_fri_bridge/motion/velocity_filter.hpp"

#include <cmath>

namespace lwr_fri_bridge {

const Vector7& VelocityFilter::update(const Vector7& position, std::uint32_t cycles, double dt) {
  if (!primed_) {
    velocity_.setZero();
    primed_ = true;
  } else {
    const Vector7 mean = (position - last_) / (dt * cycles);
    const double weight = time_constant_ > 0.0 ? -std::expm1(-dt * cycles / time_constant_) : 1.0;
    velocity_ += weight * (mean - velocity_);
  }
  last_ = position;
  return velocity_;
}

}  // namespace lwr_fri_bridge
