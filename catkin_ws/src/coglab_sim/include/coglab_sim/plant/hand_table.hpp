/// @file
/// The hand's table `config/hand_model.yaml`: phalanges, tendons, motors.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::plant {

constexpr int kMotors = 5;  ///< thumb abduction, thumb, index, middle, ring with little

/// Fingers, in the order of the touch report.
enum class Finger { Thumb, Index, Middle, Ring, Little };
constexpr int kFingers = 5;

/// One capsule on one joint. SI units; vectors are in the frame of the parent body.
struct Phalanx {
  std::string name;
  Finger finger = Finger::Thumb;
  int motor = 0;       ///< motor whose tendon bends the phalanx
  bool first = false;  ///< first of its finger: its parent body is the palm
  Vector3d pivot, axis, along;
  double lower = 0.0, upper = 0.0;  ///< rad; `lower` is open and the spring's rest angle
  double spring = 0.0;              ///< Nm/rad
  double arm = 0.0;                 ///< m, lever arm of the tendon
  double length = 0.0, radius = 0.0, mass = 0.0;
};

struct MotorRow {
  std::string name;
  double limit = 0.0;      ///< N, largest tension
  bool both_ways = false;  ///< true: also pushes
  /// m of tendon from open to closed, from the lever arms and ranges of its phalanges.
  double stroke = 0.0;
  double open_length = 0.0;  ///< m, length of the tendon with the finger open
};

struct HandTable {
  std::string palm;  ///< link of the robot description that carries the fingers
  double sliding = 0.8, torsional = 0.004, rolling = 0.0001;
  double joint_damping = 0.03, joint_armature = 2e-4;
  std::vector<Phalanx> phalanges;  ///< finger by finger, from the palm outward
  std::array<MotorRow, kMotors> motors;
  double tendon_stiffness = 5e4;
  double full_stroke = 1.0;  ///< s
  double lock_share = 0.05, lock_time = 0.2;
  double free_current = 40.0, speed_current = 60.0, stall_current = 1000.0;

  double phalangesMass() const;
};

/// Reads a table. @throws std::invalid_argument naming file, field and expected value.
HandTable readHandTable(const std::string& path);

/// The table in this package.
const HandTable& builtInHandTable();

}  // namespace coglab_sim::plant
