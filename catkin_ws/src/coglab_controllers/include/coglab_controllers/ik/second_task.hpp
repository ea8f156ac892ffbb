/// @file
/// Second task of the arm (D4.10): a constraint that uses the freedom left by the translation.
#pragma once

#include "coglab_controllers/kinematics/chain.hpp"

namespace coglab_controllers {

/// A linear constraint on the joint velocities: jacobian * qd = velocity + gain * error, with
/// `rows` rows of 7 in use.
struct TaskConstraint {
  int rows = 0;  ///< 0: no constraint in this cycle; else 2, 3 or 7
  Eigen::Matrix<double, kMaxJoints, kMaxJoints> jacobian =
      Eigen::Matrix<double, kMaxJoints, kMaxJoints>::Zero();
  JointVector velocity = JointVector::Zero();
  JointVector error = JointVector::Zero();  ///< remaining error, in the same rows
  double gain = 0.0;  ///< 1/s; TwoTaskIk reduces it so that the arm can brake in time
  /// true: near a singularity the whole task is rejected, eq. (11). false: only the singular
  /// directions are rejected. A task with more rows than the null space has dimensions needs false.
  bool reject_whole = true;
};

/// Interface of the second task of TwoTaskIk. It runs in the control cycle: no allocation, no lock,
/// no throw.
class SecondTask {
 public:
  virtual ~SecondTask() = default;
  /// Changes K_rot (1/s, finite and >= 0), between two cycles; nothing for a task without it.
  virtual void setGain(double /*gain*/) noexcept {}
  /// @param state kinematics at q (rad).
  virtual void evaluate(const ChainState& state, const JointVector& q,
                        const CartesianReference& reference,
                        TaskConstraint& constraint) const noexcept = 0;
};

/// The orientation of the hand, eq. (7).
class OrientationTask : public SecondTask {
 public:
  /// @param gain K_rot (rot_clik_gain), 1/s.  @throws std::invalid_argument unless finite and >= 0.
  explicit OrientationTask(double gain);
  void setGain(double gain) noexcept override { gain_ = gain; }
  void evaluate(const ChainState& state, const JointVector& q, const CartesianReference& reference,
                TaskConstraint& constraint) const noexcept override;

 private:
  double gain_;
};

/// The direction of one axis of the hand; the hand may turn about it. Leaves one more degree of
/// freedom than OrientationTask, for tools and objects that are round.
class AxisTask : public SecondTask {
 public:
  /// @param axis in the frame of the hand, of any length.  @param gain 1/s.
  /// @throws std::invalid_argument unless the axis has a direction, and gain is finite and >= 0.
  AxisTask(const Vector3& axis, double gain);
  void setGain(double gain) noexcept override { gain_ = gain; }
  void evaluate(const ChainState& state, const JointVector& q, const CartesianReference& reference,
                TaskConstraint& constraint) const noexcept override;

 private:
  Vector3 axis_;
  double gain_;
};

/// No second task: the null space of the translation stays still.
class NoTask : public SecondTask {
 public:
  void evaluate(const ChainState&, const JointVector&, const CartesianReference&,
                TaskConstraint&) const noexcept override {}
};

/// Second task that moves the joints towards a posture, instead of the orientation task.
class PostureTask : public SecondTask {
 public:
  /// @param posture rad.  @param gain 1/s.  @throws std::invalid_argument unless finite, gain >= 0.
  PostureTask(const JointVector& posture, double gain);
  void evaluate(const ChainState& state, const JointVector& q, const CartesianReference& reference,
                TaskConstraint& constraint) const noexcept override;

 private:
  JointVector posture_;
  double gain_;
};

}  // namespace coglab_controllers
