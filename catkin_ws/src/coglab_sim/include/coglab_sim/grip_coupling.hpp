/// @file
/// A hand that holds the object: a six-dimensional viscoelastic coupling which slips when friction
/// is not enough.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim {

/// Spring and damper between a hand and the object, anchored where the object was in the hand when
/// the grip began.
///
/// The coupling acts at the grip point: where the hand is at that moment. Its stiffness grows with
/// `closure`; its force is capped by friction, and beyond the cap the anchor follows the object
/// (slip). Nothing is attached: the load moves from one hand to the other as their closures change.
class GripCoupling {
 public:
  struct Figures {
    double stiffness = 600.0;         ///< N/m at full closure
    double rotation_stiffness = 8.0;  ///< Nm/rad at full closure
    double damping_ratio = 0.7;       ///< against mass and inertia of the object
    double lever = 0.03;              ///< m; a friction force F resists torques up to F * lever
  };

  explicit GripCoupling(const Figures& figures) : figures_(figures) {}

  /// Begins to hold: the object's present place in the hand becomes the anchor.
  void engage(const Pose& hand, const Pose& object);
  void release() { engaged_ = false; }
  bool engaged() const { return engaged_; }
  bool slipping() const { return slipping_; }

  /// Wrench on the object about its centre. Zero unless engaged.
  /// @param closure   0..1
  /// @param friction  largest force that friction can carry, N
  /// @param mass, inertia  of the object, kg and kg m^2 (smallest principal): they bound stiffness
  /// for the 1 ms step
  Wrench evaluate(const Pose& hand, const Twist& hand_twist, const Pose& object,
                  const Twist& object_twist, double closure, double friction, double mass,
                  double inertia);

 private:
  Figures figures_;
  bool engaged_ = false, slipping_ = false;
  Pose in_hand_;                            // the object in the hand when unloaded
  Vector3d grip_point_ = Vector3d::Zero();  // in the object
};

}  // namespace coglab_sim
