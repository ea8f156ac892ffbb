/// @file
/// Point-to-point motion in joint space (D4.10 Table 5). All joints arrive at the same time.
#pragma once

#include <array>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Position, velocity and acceleration at one time of a point-to-point motion.
struct PtpPoint {
  JointVector position = JointVector::Zero();      ///< rad
  JointVector velocity = JointVector::Zero();      ///< rad/s
  JointVector acceleration = JointVector::Zero();  ///< rad/s^2
};

/// Synchronised trapezoidal motion from any position and velocity to rest at a target.
///
/// The slowest joint moves as fast as its limits allow; the others arrive at the same time. From
/// rest the path is a straight line in joint space. The constructor plans and may throw; `at`
/// neither allocates nor throws.
class PtpTrajectory {
 public:
  /// At rest at zero, duration 0.
  PtpTrajectory() = default;

  /// @param position, velocity start, rad and rad/s; a joint faster than max_velocity first brakes.
  /// @param target rad.  @param max_velocity, max_acceleration positive, rad/s and rad/s^2.
  /// @param joints number of joints that move; the others keep their positions.
  /// @throws std::invalid_argument with the joint and the field that is not finite or not positive.
  PtpTrajectory(const JointVector& position, const JointVector& velocity, const JointVector& target,
                const JointVector& max_velocity, const JointVector& max_acceleration,
                int joints = kMaxJoints);

  double duration() const noexcept { return duration_; }  ///< s
  const JointVector& target() const noexcept { return target_; }

  /// State at `t` s after the start. From duration() on: exactly the target, at rest. Before 0: the
  /// start.
  void at(double t, PtpPoint& point) const noexcept;

 private:
  struct Ramp {  // accelerate to `cruise`, hold it, brake to rest
    double start = 0, velocity = 0, cruise = 0, acceleration = 1;
    double accelerate_time = 0, cruise_time = 0, brake_time = 0;
  };
  static Ramp fastest(double distance, double velocity, double max_velocity,
                      double max_acceleration);
  static Ramp stretched(double distance, double velocity, double acceleration, double duration);

  double duration_ = 0.0;
  JointVector target_ = JointVector::Zero();
  std::array<Ramp, kMaxJoints> ramps_{};
};

}  // namespace coglab_controllers
