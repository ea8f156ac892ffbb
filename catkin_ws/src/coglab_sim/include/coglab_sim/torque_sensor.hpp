/// @file
/// Joint torque signals as imperfect as D4.10 describes those of the real arm.
///
///   measured = ideal joint torque + offset + noise
///   external = estimate from ideal torques - offset + bias(q) + hysteresis sign(dq) + noise,
///   noise AR(1) with deviation sigma (1 + k |dq|)
///
/// An offset that depends on the posture stays in the estimate and the noise grows about eightfold
/// at 1 rad/s: this is why contact has to be detected from changes, and only while the arm stands
/// still.
#pragma once

#include "coglab_sim/geometry.hpp"
#include "coglab_sim/random.hpp"

namespace coglab_sim {

/// All defaults are ours, to be replaced by a recording of a real arm at rest.
struct TorqueNoise {
  double sigma = 0.05;             ///< Nm; 0.05 stands for good sensors, 0.15 for bad ones
  double speed_gain = 7.0;         ///< s/rad, k above; |dq| is the largest joint speed
  double correlation_time = 0.01;  ///< s
  double bias = 0.4;               ///< Nm, amplitude of the posture-dependent offset
  double offset = 0.3;             ///< Nm, largest of the constant offsets of the sensors
  double hysteresis = 0.1;         ///< Nm
  double hysteresis_speed = 0.02;  ///< rad/s over which it reverses
};

/// Adds the errors. One instance per arm; the same seed gives the same errors.
class TorqueSensor {
 public:
  TorqueSensor(const TorqueNoise& noise, std::uint64_t seed);

  /// Draws the noise of the next `dt` seconds.
  void advance(const Vector7& velocity, double dt);

  /// Torque as measured, Nm.
  Vector7 measured(const Vector7& ideal) const { return ideal + offset_ + measured_noise_; }

  /// External torque as the controller estimates it, Nm.
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
