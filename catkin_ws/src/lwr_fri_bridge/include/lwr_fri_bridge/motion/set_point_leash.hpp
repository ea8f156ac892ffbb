/// @file
/// Bounds |commanded - measured| per joint, so that a person who blocks the arm is not met by a
/// leap when letting go.
#pragma once

#include "lwr_fri_bridge/names.hpp"
#include "lwr_fri_bridge/requests/events.hpp"

namespace lwr_fri_bridge {

/// What the leash of every joint is made of; ours.
struct LeashLengths {
  double position = 0.05;   ///< rad, position mode, 0.005..0.5
  double impedance = 0.10;  ///< rad, impedance modes, the least, 0.005..0.5
  double load = 10.0;       ///< N at the hand that the controller's load data do not know and that
                            ///< may deflect an impedance without counting as a block, 0..70
};

/// Leash per joint (rad) in a control mode. In the impedance modes the arm gives way by load over
/// stiffness although nothing blocks it (an object in the hand, friction), so a soft joint needs a
/// longer leash: joint impedance max(impedance, load * lever / k), with the largest lever from the
/// joint's axis to the hand (A1 A2 1.0 m, E1 A3 0.6 m, A4..A6 0.2 m); Cartesian impedance
/// max(impedance, load / (k 0.4 m) + load * 0.1 m / k_rot) with the softest directions. Never above
/// 0.5 rad. Real-time safe.
Vector7 leashOf(const ControlMode& mode, const LeashLengths& lengths);

/// The leash trips when the set-point of a joint moves away from the arm beyond the leash, as two
/// measurements in a row show it: a single false one moves nothing. From
/// then on all joints stop, and those whose set-point is noticeably ahead return to where the arm
/// was when it tripped: that point is fixed, so an arm that sags or is pushed does not drag the
/// set-point along. It lets go when the set-points are back and the outward motion is not asked for
/// any more. Real-time safe.
class SetPointLeash {
 public:
  /// Forgets a trip (monitor mode, no power: the set-point is the controller's).
  void reset() {
    joint_ = -1;
    measured_once_ = false;
  }

  /// Judges one tick and, while tripped, overwrites `target` (rad/s) with the velocities of the
  /// return. `wanted`: velocities asked for by the user of the bridge, before any bound. `leash`
  /// per joint in rad. Returns whether the leash is tripped.
  bool update(const Interpolator& interpolator, const Vector7& measured, const Vector7& wanted,
              const Vector7& leash, const JointLimits& limits, Vector7& target);

  /// The joint that tripped it, -1 if none.
  int joint() const { return joint_; }

 private:
  int joint_ = -1;
  bool measured_once_ = false;
  Vector7 measured_ = Vector7::Zero();  // of the tick before
  Vector7 home_ = Vector7::Zero();      // measured positions at the trip, the nearer of two
  Vector7 direction_ =
      Vector7::Zero();  // sign of commanded - measured of the joints that must return, else 0
};

}  // namespace lwr_fri_bridge
