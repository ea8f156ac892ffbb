/// @file
/// How much a goal trembles: what tells the noise of a tracker from the motion of a person.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Measures the noise of a goal from its steps between frames.
///
/// The change of the change of three successive steps is nearly zero for whatever a person's hand
/// does between frames of 30 Hz (its jerk), and large for noise, white or wandering. No allocation,
/// no throw.
class GoalJitter {
 public:
  /// @param full the speed() that counts as full noise, m/s or rad/s
  explicit GoalJitter(double full) noexcept : full_(full) {}

  void reset() noexcept;
  /// One cycle of `dt` s without a new frame.
  void wait(double dt) noexcept;
  /// One cycle of `dt` s with a new frame, `step` away from the one before (m, or rad as a rotation
  /// vector).
  void see(double dt, const Vector3& step) noexcept;

  /// About the speed that the noise gives to a set-point that follows the goal, m/s or rad/s (root
  /// of the mean square).
  double speed() const noexcept;
  /// The same, 0: none, to 1: full.
  double share() const noexcept;

 private:
  double full_;
  Vector3 last_ = Vector3::Zero(), before_ = Vector3::Zero();  // steps
  int steps_ = 0;
  double power_ = 0.0;  // squared steps of noise per second
};

}  // namespace coglab_controllers
