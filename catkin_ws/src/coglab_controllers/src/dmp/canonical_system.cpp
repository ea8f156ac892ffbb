#include "coglab_controllers/dmp/canonical_system.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

CanonicalSystem::CanonicalSystem(double alpha) : alpha_(alpha) {
  if (!(alpha > 0.0 && alpha <= 50.0)) {
    throw std::invalid_argument("alpha: expected 0 < alpha <= 50, got " + std::to_string(alpha));
  }
}

double CanonicalSystem::advance(double s, double dt, double tau) const noexcept {
  return s * std::exp(-alpha_ * dt / tau);
}

double CanonicalSystem::timeAt(double s, double tau) const noexcept {
  return -std::log(s) * tau / alpha_;
}

}  // namespace coglab_controllers
