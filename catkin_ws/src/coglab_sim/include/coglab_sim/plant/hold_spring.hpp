/// @file
/// A compliant and limited hold of a free body: a spring and a damper in six directions.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::plant {

constexpr double kGravity = 9.81;  ///< m/s^2, along -z, as the model has it

/// A free body about its centre of mass.
struct FreeBody {
  Pose center;  ///< centre of mass with the body's axes, in the world
  Twist twist;  ///< of the centre, world axes
  double mass = 1.0;
  Vector3d inertia = Vector3d::Ones();  ///< diagonal in the body's axes, kg m^2
};

/// How stiff and how strong a hold is.
struct HoldLimits {
  double bandwidth = 60.0;  ///< rad/s, critically damped
  double force = 40.0;      ///< N, largest
  double torque = 2.0;      ///< Nm, largest
};

/// The gains follow from the mass and from each axis's own inertia, so that a light body is held
/// as steadily as a heavy one. The weight of a body that belongs to the hand is carried ahead of
/// the error; of one that is taken where another holds it, the hold carries only what the hand
/// lifts. What the limits do not carry slips: the place where the hold would have the body follows
/// it.
class HoldSpring {
 public:
  /// The body, held by another or at rest, is to stay where it is now in the frame of the hand.
  void engage(const Pose& hand, const Pose& center) {
    engageAt(hand.inverse() * center);
    carries_ahead_ = false;
  }
  /// The body belongs to the hand, there in its frame.
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
  Pose in_hand_;  // where the body's centre belongs
};

}  // namespace coglab_sim::plant
