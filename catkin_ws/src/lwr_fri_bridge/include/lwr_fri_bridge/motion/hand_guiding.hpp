/// @file
/// Hand guiding: a person moves the arm in joint impedance with almost no stiffness, and the
/// set-point follows the arm. Without that, the robot controller would pull the arm back to where
/// the guiding began as soon as it leaves the mode, with its own, high stiffness.
#pragma once

#include "lwr_fri_bridge/names.hpp"
#include "lwr_fri_bridge/requests/events.hpp"

namespace lwr_fri_bridge {

/// Nm/rad; a joint with this stiffness or less counts as guided by hand.
constexpr double kGuidingStiffness = 0.1;

/// True if a person can guide the arm in this mode: joint impedance, no joint stiffer than
/// kGuidingStiffness. Real-time safe.
bool isHandGuiding(const ControlMode& mode);

/// Velocities (rad/s) that bring the set-point to the measured joints (rad), within the limits, so
/// that it can brake there. Real-time safe.
Vector7 velocityToArm(const Interpolator& interpolator, const Vector7& measured,
                      const JointLimits& limits);

}  // namespace lwr_fri_bridge
