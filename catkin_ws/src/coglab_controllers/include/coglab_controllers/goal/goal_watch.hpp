/// @file
/// When a goal that moves is no goal any more: it leaves its region, goes back, or falls.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// What a goal frame may do during a motion. The defaults let it do anything.
struct GoalLimits {
  Vector3 region_low = Vector3::Zero();   ///< m, corners of a box in dmp_frame_name that a goal
  Vector3 region_high = Vector3::Zero();  ///< which was inside may not leave; equal: anywhere
  double retreat = 0.0;  ///< m, how far it may go back from where it was nearest; 0: any way
  double drop = 0.0;  ///< m, how far it may sink below where it was on average of kDropTime; 0: any

  /// What is wrong with them; empty: nothing.
  const char* wrong() const noexcept;
};

/// Watches the goal of one motion, so that nothing is chased. No allocation, no throw.
class GoalWatch {
 public:
  static constexpr double kDropTime = 0.15;  ///< s

  /// A motion from `hand` (m, in dmp_frame_name) toward `goal` begins.
  void begin(const GoalLimits& limits, const Vector3& hand, const Vector3& goal) noexcept;

  /// One cycle of `dt` s. @param goal frame that is believed, m, in dmp_frame_name.
  /// @return why the motion has to end; empty: it may go on
  Reason update(double dt, const Vector3& goal) noexcept;

 private:
  bool outside(const Vector3& goal) const noexcept;

  GoalLimits limits_;
  Vector3 hand_ = Vector3::Zero();
  double nearest_ = 0.0;  // m
  double height_ = 0.0;   // m, averaged
  bool was_inside_ = false;
};

}  // namespace coglab_controllers
