/// @file
/// Joint torque signals with the errors that D4.10 describes for the real arm.
///
///   measured = ideal joint torque + offset + noise
///   external = estimate from ideal torques - offset + bias(q) + hysteresis sign(dq) + noise,
///   noise AR(1) with deviation sigma (1 + k |dq|)
///
/// The estimate keeps an offset that depends on the posture, and at 1 rad/s its noise is about
/// eight times larger. Contact must therefore be detected from changes, while the arm stands still.
#pragma once

#include "coglab_sim/geometry.hpp"
#include "coglab_sim/random.hpp"

namespace coglab_sim {

/// Defaults, units and texts are in parameter_table.inc.
struct TorqueNoise {
#define TORQUE_NOISE(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// Adds the errors. Use one instance per arm; the same seed gives the same errors.
class TorqueSensor {
 public:
  TorqueSensor(const TorqueNoise& noise, std::uint64_t seed);

  /// Draws the noise of the next `dt` seconds.
  void advance(const Vector7& velocity, double dt);

  /// Measured torque, Nm.
  Vector7 measured(const Vector7& ideal) const { return ideal + offset_ + measured_noise_; }

  /// External torque estimated by the controller, Nm.
  Vector7 external(const Vector7& ideal, const Vector7& position) const;

  const TorqueNoise& noise() const { return noise_; }

 private:
  TorqueNoise noise_;
  Random random_;
  Vector7 measured_noise_ = Vector7::Zero(), external_noise_ = Vector7::Zero(),
          friction_ = Vector7::Zero();
  Vector7 bias_phase_, bias_rate_, offset_;
};

}  // namespace coglab_sim
