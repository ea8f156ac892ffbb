/// @file
/// Compliant, limited hold of a free body: spring and damper in six directions.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::plant {

constexpr double kGravity = 9.81;  ///< m/s^2, along -z, as in the model

/// A free body about its centre of mass.
struct FreeBody {
  Pose center;  ///< centre of mass with the body's axes, in the world
  Twist twist;  ///< of the centre, world axes
  double mass = 1.0;
  Vector3d inertia = Vector3d::Ones();  ///< diagonal in the body's axes, kg m^2
};

/// Stiffness and strength of a hold.
struct HoldLimits {
  double bandwidth = 60.0;  ///< rad/s, critically damped
  double force = 40.0;      ///< N, largest
  double torque = 2.0;      ///< Nm, largest
};

/// Gains follow from the mass and the inertia about each axis, so that light and heavy bodies are
/// held equally steadily. After engageAt() the hold carries the full weight as feed-forward. After
/// engage() another holder carries the weight, and the hold carries only the part that the hand
/// lifts. Beyond the limits the body slips: the target pose follows the body.
class HoldSpring {
 public:
  /// Holds the body at its present pose in the hand. Another holder or a support carries its
  /// weight.
  void engage(const Pose& hand, const Pose& center) {
    engageAt(hand.inverse() * center);
    carries_ahead_ = false;
  }
  /// Holds the body at the pose `in_hand` in the hand's frame, with its whole weight.
  void engageAt(const Pose& in_hand) {
    in_hand_ = in_hand;
    engaged_ = carries_ahead_ = true;
  }
  void release() { engaged_ = false; }

  /// Force and torque on the body about its centre, world axes. `share` 0..1 fades the hold.
  Wrench evaluate(const Pose& hand, const Twist& hand_twist, const FreeBody& body,
                  const HoldLimits& limits, double share);

  bool engaged() const { return engaged_; }

 private:
  bool engaged_ = false, carries_ahead_ = false;
  Pose in_hand_;  // target pose of the body's centre
};

}  // namespace coglab_sim::plant
