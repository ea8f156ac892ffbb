/// @file
/// Bounds |commanded - measured| per joint, so that a person who blocks the arm is not met by a
/// leap when letting go.
#pragma once

#include "lwr_fri_bridge/interpolator.hpp"

namespace lwr_fri_bridge {

/// The leash trips when the set-point of a joint moves away from the arm beyond the leash. From
/// then on all joints stop, and those whose set-point is noticeably ahead return to where the arm
/// was when it tripped: that point is fixed, so an arm that sags or is pushed does not drag the
/// set-point along. It lets go when the set-points are back and the outward motion is not asked for
/// any more. Real-time safe.
class SetPointLeash {
 public:
  /// Forgets a trip (monitor mode, no power: the set-point is the controller's).
  void reset() { joint_ = -1; }

  /// Judges one tick and, while tripped, overwrites `target` (rad/s) with the velocities of the
  /// return. `wanted`: velocities asked for by the user of the bridge, before any bound. `leash` in
  /// rad. Returns whether the leash is tripped.
  bool update(const Interpolator& interpolator, const Vector7& measured, const Vector7& wanted,
              double leash, const JointLimits& limits, Vector7& target);

  /// The joint that tripped it, -1 if none.
  int joint() const { return joint_; }

 private:
  int joint_ = -1;
  Vector7 home_ = Vector7::Zero();  // measured positions at the trip
  Vector7 direction_ =
      Vector7::Zero();  // sign of commanded - measured of the joints that must return, else 0
};

}  // namespace lwr_fri_bridge
