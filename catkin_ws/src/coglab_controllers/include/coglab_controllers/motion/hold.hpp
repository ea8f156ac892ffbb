/// @file
/// Behaviour between motions: the arm brakes, then stands exactly still. Feedback controllers may
/// move it.
#pragma once

#include "coglab_controllers/manager/motion_controller.hpp"

namespace coglab_controllers {

/// Lets a motion start without a step if the commanded and the measured state differ.
///
/// References begin at the commanded state, and control loops use the measured one. At the start of
/// a motion their difference does not count as an error; it is blended in within about `blend` s.
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

/// Correction of a pose by feedback controllers: p' = p + shift, R' = turn R.
struct PoseCorrection {
  Vector3 shift = Vector3::Zero();  ///< m
  Quaternion turn = Quaternion::Identity();

  static PoseCorrection between(const Eigen::Matrix<double, 7, 1>& before,
                                const Eigen::Matrix<double, 7, 1>& after) noexcept;
  bool none() const noexcept {
    return shift.isZero(0.0) && turn.coeffs() == Quaternion::Identity().coeffs();
  }
  Pose onto(const Pose& pose) const noexcept;   ///< corrected pose; bit-identical if none()
  Pose outOf(const Pose& pose) const noexcept;  ///< inverse: the pose before the correction
};

/// The arm brakes within its limits. Once it stands, the commanded posture is the reference. If
/// feedback controllers do not change the reference, the velocity is exactly zero; if they change
/// it, the hand follows. No allocation, no throw.
///
/// The reference is the commanded pose without its present correction, so a constant correction
/// causes no motion.
///
/// All joints brake in proportion to their speeds, within the braking time of the slowest one. If
/// each joint braked as fast as possible, joints whose motions cancel each other (as in a hand that
/// only turns) would move the hand aside.
class Hold {
 public:
  /// Begins a new hold. The arm may still be moving.
  void begin() noexcept {
    latched_ = false;
    begins_ = true;
  }

  /// Writes pose, zero twist, joint position and the joint velocity of braking (zero at rest).
  /// @param correction of the pose in the last cycle
  void computeReference(const CycleInput& input, const RobotSetup& setup,
                        const PoseCorrection& correction, References& references) noexcept;

  /// @param solve computes joint velocities from a chain state, joints and a Cartesian reference:
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

  /// Joint velocities (rad/s) while braking. The slowest joint sets the duration for all.
  JointVector braked(const RobotSample& robot, const coglab_rt::JointLimits& limits) noexcept;

  bool latched_ = false, begins_ = true;
  JointVector from_ = JointVector::Zero();  // rad/s, when it began to brake
  int slowest_ = 0;                         // joint with the longest braking time
  Eigen::Array<bool, kMaxJoints, 1> slow_ = Eigen::Array<bool, kMaxJoints, 1>::Constant(true);
  double share_ = 1.0;    // of from_, in the last cycle
  ChainState commanded_;  // kinematics at the commanded joints
  Eigen::Matrix<double, 7, 1> pose_ = Eigen::Matrix<double, 7, 1>::Zero();
  JointVector joints_ = JointVector::Zero();
};

/// Writes a pose into the references.
inline void writePose(References& references, const Pose& pose) noexcept {
  references.states.view<7>(references.pose) << pose.position, pose.orientation.coeffs();
}

}  // namespace coglab_controllers
