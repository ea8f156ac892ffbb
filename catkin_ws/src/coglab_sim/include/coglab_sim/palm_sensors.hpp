/// @file
/// An IMU and a wrench sensor in the palm, with white noise and constant errors drawn by the seed.
#pragma once

#include "coglab_sim/geometry.hpp"
#include "coglab_sim/plant/plant.hpp"
#include "coglab_sim/random.hpp"

namespace coglab_sim {

/// Defaults, units and texts are in parameter_table.inc.
struct PalmNoise {
#define PALM_NOISE(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// One measurement, axes of ih2_palm.
struct PalmReading {
  Quaterniond orientation = Quaterniond::Identity();  ///< of ih2_palm in the world
  Vector3d angular_velocity = Vector3d::Zero();       ///< rad/s
  Vector3d linear_acceleration = Vector3d::Zero();    ///< m/s^2, with gravity: +9.81 upward at rest
  Vector3d force = Vector3d::Zero();                  ///< N, of object, person and push on the hand
  Vector3d torque = Vector3d::Zero();                 ///< Nm, about the origin of ih2_palm
};

/// Measures the mean between two readings, as a sensor with a low-pass filter does.
class PalmSensors {
 public:
  PalmSensors(const PalmNoise& noise, std::uint64_t seed);

  /// Adds one physics step of `dt` s.
  void observe(const plant::Plant& plant, double dt);
  /// Makes a reading from the steps since the last one.
  void read();
  const PalmReading& reading() const { return reading_; }

 private:
  Vector3d white(double deviation);

  PalmNoise noise_;
  Random random_;
  Vector3d turned_, rate_bias_, acceleration_bias_, force_bias_, torque_bias_;  // constant errors
  double time_ = 0.0;                     // s since the last reading
  PalmReading mean_;                      // without errors; the orientation is the newest
  Vector3d velocity_ = Vector3d::Zero();  // m/s, world, of the last step
  bool moved_ = false;                    // there was a step before
  PalmReading reading_;
};

}  // namespace coglab_sim
