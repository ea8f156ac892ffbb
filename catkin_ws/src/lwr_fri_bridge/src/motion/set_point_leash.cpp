#include "lwr_fri_bridge/motion/set_point_leash.hpp"

#include <algorithm>
#include <cmath>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kReturnSpeed = 0.3;   // rad/s; relaxes a blocked arm within about 1 s
constexpr double kReturnDelay = 0.05;  // s, time constant of the end of the return
constexpr double kReturned = 1e-3;     // rad
constexpr double kNoticeable = 0.1;    // share of the leash; joints less ahead do not return

constexpr double kLongest = 0.5;  // rad
constexpr double kLever[7] = {1.0, 1.0, 0.6, 0.6,
                              0.2, 0.2, 0.2};  // m, joint axis to hand, stretched
constexpr double kReach = 0.4;      // m of hand displacement per rad of a joint, in a usual posture
constexpr double kLoadLever = 0.1;  // m, from the tool's origin to the load

}  // namespace

Vector7 leashOf(const ControlMode& mode, const LeashLengths& lengths) {
  Vector7 leash = Vector7::Constant(lengths.position);
  switch (mode.strategy) {
    case fri::ControlStrategy::JointImpedance:
      for (int i = 0; i < 7; ++i)
        leash[i] = std::max(lengths.impedance, lengths.load * kLever[i] / mode.joint_stiffness[i]);
      break;
    case fri::ControlStrategy::CartesianImpedance: {
      const double translation = mode.cartesian_stiffness.head<3>().minCoeff();
      const double rotation = mode.cartesian_stiffness.tail<3>().minCoeff();
      leash.setConstant(std::max(lengths.impedance, lengths.load / (translation * kReach) +
                                                        lengths.load * kLoadLever / rotation));
      break;
    }
    case fri::ControlStrategy::Position:
    case fri::ControlStrategy::Other:
      break;
  }
  return leash.cwiseMin(kLongest);
}

bool SetPointLeash::update(const Interpolator& interpolator, const Vector7& measured,
                           const Vector7& wanted, const Vector7& leash, const JointLimits& limits,
                           Vector7& target) {
  const Vector7 before = measured_once_ ? measured_ : measured;
  measured_ = measured;
  measured_once_ = true;
  if (joint_ < 0) {
    // Uses the measurement that is nearer to the set-point, of this tick and the previous one.
    const Vector7 position = interpolator.position();
    const auto newer_counts =
        (position - measured).array().abs() < (position - before).array().abs();
    const Vector7 arm = newer_counts.select(measured, before);
    const Vector7 ahead = position - arm;
    for (int i = 0; i < 7; ++i) {
      const bool outward =
          interpolator.velocity()[i] * ahead[i] > 0.0 || target[i] * ahead[i] > 0.0;
      if (outward && std::abs(ahead[i]) > leash[i]) joint_ = i;
    }
    if (joint_ < 0) return false;
    home_ = arm;
    for (int i = 0; i < 7; ++i) {
      direction_[i] =
          std::abs(ahead[i]) > kNoticeable * leash[i] ? std::copysign(1.0, ahead[i]) : 0.0;
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
