/// @file
/// Reference of a motion for one control cycle.
#pragma once

#include <cstdint>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// The reference of one cycle: joints, a pose of the tool, or rest. A motion gives the
/// position now and at the end of the cycle. The velocity is their difference divided by dt, so a
/// slowed clock slows the velocity too.
class MotionReference {
 public:
  enum class Space : std::uint8_t {
    Rest,   ///< the arm brakes, then stands, open to feedback controllers
    Joint,  ///< joint positions
    Pose    ///< pose of the tool frame in the robot's base frame
  };

  /// @param dt of this cycle, s
  explicit MotionReference(double dt = 1.0) noexcept : dt_(dt) {}

  /// The arm brakes and stands.
  void rest() noexcept { space = Space::Rest; }

  /// @param now, next rad, seven joints in wire order
  void joints(const JointVector& now, const JointVector& next) noexcept {
    space = Space::Joint;
    joint_position = now;
    joint_next = next;
    joint_velocity = (next - now) / dt_;
  }

  /// @param now, next of the tool frame in the robot's base frame
  void pose(const Pose& now, const Pose& next) noexcept {
    cartesian({now, (next.position - now.position) / dt_,
               rotationBetween(now.orientation, next.orientation) / dt_, true});
  }

  /// A pose with the velocities that lead from it to that of the next cycle; the orientation may be
  /// left free.
  void cartesian(const CartesianReference& reference) noexcept {
    space = Space::Pose;
    tool = reference;
  }

  /// The tool at the end of the cycle.
  Pose nextTool() const noexcept {
    return {tool.pose.position + dt_ * tool.velocity,
            (expRotation(dt_ * tool.angular_velocity) * tool.pose.orientation).normalized()};
  }

  Space space = Space::Rest;
  JointVector joint_position = JointVector::Zero();  ///< rad, now
  JointVector joint_next = JointVector::Zero();      ///< rad, at the end of the cycle
  JointVector joint_velocity = JointVector::Zero();  ///< rad/s
  CartesianReference tool;
  /// True if the reference does not continue that of the last cycle. Its difference to the arm then
  /// fades in as an error within `hold_blend`.
  bool jumps = false;
  /// Factor 0..1 on the velocity of the pose control, to fade a motion out.
  double share = 1.0;

 private:
  double dt_;
};

}  // namespace coglab_controllers
