#include "lwr_fri_bridge/motion/hand_guiding.hpp"

#include <algorithm>
#include <cmath>

namespace lwr_fri_bridge {
namespace {

constexpr double kDelay = 0.03;  // s, time constant of the end of the way to the arm

}  // namespace

bool isHandGuiding(const ControlMode& mode) {
  return mode.strategy == fri::ControlStrategy::JointImpedance &&
         mode.joint_stiffness.maxCoeff() <= kGuidingStiffness;
}

Vector7 velocityToArm(const Interpolator& interpolator, const Vector7& measured,
                      const JointLimits& limits) {
  Vector7 velocity;
  for (int i = 0; i < 7; ++i) {
    const double distance = measured[i] - interpolator.position()[i];
    const double speed =
        brakingSpeed(std::abs(distance), limits.acceleration[i], limits.jerk[i], kDelay);
    velocity[i] = std::copysign(std::min(speed, limits.velocity[i]), distance);
  }
  return velocity;
}

}  // namespace lwr_fri_bridge
