/// @file
/// Behaviour between motions: the arm brakes, then stands exactly still. Feedback controllers may
/// move it.
#pragma once

#include "coglab_controllers/manager/motion_controller.hpp"

namespace coglab_controllers {

/// Lets a motion start without a step if the commanded and the measured state differ.
///
/// References begin at the commanded state, and loops close on the measured one. At the start of a
/// motion the difference of the two counts as no error; it becomes one within about `blend`
/// seconds.
class StartBlend {
 public:
  /// @param blend time constant, s
  void setTime(double blend) { blend_ = blend; }
  void begin(const Vector3& position, const Vector3& rotation, const JointVector& joints) noexcept {
    position_ = position;
    rotation_ = rotation;
    joints_ = joints;
  }
  void advance(double dt) noexcept;
  const Vector3& position() const noexcept { return position_; }  ///< m
  const Vector3& rotation() const noexcept { return rotation_; }  ///< rad, rotation vector
  const JointVector& joints() const noexcept { return joints_; }  ///< rad

 private:
  double blend_ = 0.15;
  Vector3 position_ = Vector3::Zero(), rotation_ = Vector3::Zero();
  JointVector joints_ = JointVector::Zero();
};

/// What feedback controllers made of a pose: p' = p + shift, R' = turn R.
struct PoseCorrection {
  Vector3 shift = Vector3::Zero();  ///< m
  Quaternion turn = Quaternion::Identity();

  static PoseCorrection between(const Eigen::Matrix<double, 7, 1>& before,
                                const Eigen::Matrix<double, 7, 1>& after) noexcept;
  bool none() const noexcept {
    return shift.isZero(0.0) && turn.coeffs() == Quaternion::Identity().coeffs();
  }
  Pose onto(const Pose& pose) const noexcept;   ///< the corrected pose; the same bits if none()
  Pose outOf(const Pose& pose) const noexcept;  ///< the pose that is corrected to this one
};

/// The arm brakes within its limits; once it stands, the commanded posture is remembered as the
/// reference. If feedback controllers leave the reference alone, the velocity is exactly zero; if
/// they move it, the hand follows. No allocation, no throw.
///
/// The reference is the commanded pose without the correction that it has already: a constant
/// correction moves nothing.
///
/// All joints brake together, each in proportion to its speed, in the time that the slowest one
/// needs: where each braked as fast as it can, joints that cancel each other's motion, as in a hand
/// that only turns, would throw the hand aside.
class Hold {
 public:
  /// Another hold begins: the arm may still be moving.
  void begin() noexcept {
    latched_ = false;
    begins_ = true;
  }

  /// Writes pose, zero twist, joint position and the joint velocity of braking, at rest zero.
  /// @param correction of the pose in the cycle before
  void computeReference(const CycleInput& input, const RobotSetup& setup,
                        const PoseCorrection& correction, References& references) noexcept;

  /// @param solve makes joint velocities from a chain state, joints and a Cartesian reference:
  /// (const ChainState&, const
  ///        JointVector&, const CartesianReference&) -> JointVector
  template <typename Solve>
  void resolve(const CycleInput& input, References& references, Solve&& solve) noexcept {
    if (!moved(references)) return;  // it brakes, or stands
    CartesianReference reference;
    const auto pose = references.states.view<7>(references.pose);
    reference.pose.position = pose.head<3>();
    reference.pose.orientation = Quaternion(pose[6], pose[3], pose[4], pose[5]);
    const auto twist = references.states.view<6>(references.twist);
    reference.velocity = twist.head<3>();
    reference.angular_velocity = twist.tail<3>();
    references.states.view<kMaxJoints>(references.joint_velocity) =
        solve(commanded_, input.robot.commanded_position, reference);
  }

 private:
  bool moved(const References& references) const noexcept;

  /// Joint velocities (rad/s) of braking: the slowest joint brakes as it can, the others with it.
  JointVector braked(const RobotSample& robot, const coglab_rt::JointLimits& limits) noexcept;

  bool latched_ = false, begins_ = true;
  JointVector from_ = JointVector::Zero();  // rad/s, when it began to brake
  int slowest_ = 0;                         // the joint that needs longest for that
  Eigen::Array<bool, kMaxJoints, 1> slow_ = Eigen::Array<bool, kMaxJoints, 1>::Constant(true);
  double share_ = 1.0;    // of from_, in the last cycle
  ChainState commanded_;  // kinematics at the commanded joints
  Eigen::Matrix<double, 7, 1> pose_ = Eigen::Matrix<double, 7, 1>::Zero();
  JointVector joints_ = JointVector::Zero();
};

/// Pose of a reference as the stores keep it.
inline void writePose(References& references, const Pose& pose) noexcept {
  references.states.view<7>(references.pose) << pose.position, pose.orientation.coeffs();
}

}  // namespace coglab_controllers
