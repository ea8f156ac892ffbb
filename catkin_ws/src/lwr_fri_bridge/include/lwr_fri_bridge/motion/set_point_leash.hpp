/// @file
/// Bounds |commanded - measured| per joint. The arm then does not leap when a person who blocked it
/// lets go.
#pragma once

#include "lwr_fri_bridge/names.hpp"
#include "lwr_fri_bridge/requests/events.hpp"

namespace lwr_fri_bridge {

/// Parameters of the leash (CogLab's own values). The leash is the largest allowed |commanded -
/// measured| of a joint.
struct LeashLengths {
  double position = 0.05;   ///< rad, position mode, 0.005..0.5
  double impedance = 0.10;  ///< rad, minimum in the impedance modes, 0.005..0.5
  double load = 10.0;       ///< N at the hand beyond the controller's load data, 0..70; it may
                            ///< deflect an impedance without counting as a block
};

/// Leash per joint (rad) in a control mode. In the impedance modes a load (an object in the hand,
/// friction) deflects the arm by load over stiffness, although nothing blocks it. A soft joint
/// therefore needs a longer leash. Joint impedance: max(impedance, load * lever / k), with the
/// largest lever from the joint's axis to the hand (A1 A2 1.0 m, E1 A3 0.6 m, A4..A6 0.2 m).
/// Cartesian impedance: max(impedance, load / (k 0.4 m) + load * 0.1 m / k_rot) with the softest
/// directions. At most 0.5 rad. Real-time safe.
Vector7 leashOf(const ControlMode& mode, const LeashLengths& lengths);

/// The leash trips when the set-point of a joint moves away from the arm beyond the leash in two
/// measurements in a row, so a single false measurement has no effect. While it is tripped, all
/// joints stop. Joints whose set-point is noticeably ahead return to the arm's position at the
/// trip. This position is fixed, so an arm that sags or is pushed does not drag the set-point
/// along. The leash is released when the set-points are back and no outward motion is requested.
/// Real-time safe.
class SetPointLeash {
 public:
  /// Clears a trip (monitor mode, no power: the controller sets the set-point).
  void reset() {
    joint_ = -1;
    measured_once_ = false;
  }

  /// Checks one tick. While tripped, overwrites `target` (rad/s) with the velocities of the return.
  /// `wanted`: velocities that the user of the bridge requests, before any limit (rad/s). `leash`
  /// per joint in rad. Returns true if the leash is tripped.
  bool update(const Interpolator& interpolator, const Vector7& measured, const Vector7& wanted,
              const Vector7& leash, const JointLimits& limits, Vector7& target);

  /// Index of the joint that tripped it; -1: none.
  int joint() const { return joint_; }

 private:
  int joint_ = -1;
  bool measured_once_ = false;
  Vector7 measured_ = Vector7::Zero();  // previous tick
  Vector7 home_ = Vector7::Zero();      // measured positions at the trip, the nearer of two
  Vector7 direction_ =
      Vector7::Zero();  // sign of commanded - measured of the joints that must return, else 0
};

}  // namespace lwr_fri_bridge
