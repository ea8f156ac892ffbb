#include "coglab_controllers/goal/goal_jitter.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_controllers {
namespace {

constexpr double kMemory = 0.35;  // s

// What a primitive with the usual stiffness lets pass of noise that wanders: mean square speed over
// squared steps per second, 1/s.
constexpr double kPassed = 5.0;

}  // namespace

void GoalJitter::reset() noexcept {
  steps_ = 0;
  power_ = 0.0;
}

void GoalJitter::wait(double dt) noexcept {
  if (power_ > 0.0) power_ *= std::exp(-dt / kMemory);
}

void GoalJitter::see(double dt, const Vector3& step) noexcept {
  wait(dt);
  if (++steps_ >= 3) {
    // Steps that are noise alone make a difference of six times their mean square. A goal that
    // jumps is no noise: one frame cannot count for more than full noise.
    const double square = (step - 2.0 * last_ + before_).squaredNorm() / 6.0;
    power_ += std::min(square / kMemory, full_ * full_ / kPassed);
  }
  before_ = last_;
  last_ = step;
}

double GoalJitter::speed() const noexcept { return std::sqrt(kPassed * power_); }

double GoalJitter::share() const noexcept { return std::min(1.0, speed() / full_); }

}  // namespace coglab_controllers
