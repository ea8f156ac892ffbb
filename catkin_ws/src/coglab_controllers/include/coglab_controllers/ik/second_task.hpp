/// @file
/// What the arm does with the freedom that the translation leaves: one constraint among possible
/// others (D4.10).
#pragma once

#include "coglab_controllers/kinematics/chain.hpp"

namespace coglab_controllers {

/// A linear constraint on the joint velocities: jacobian * qd = velocity + gain * error, with
/// `rows` rows of 7 in use.
struct TaskConstraint {
  int rows = 0;  ///< 0: no constraint in this cycle; else 3 or 7
  Eigen::Matrix<double, kMaxJoints, kMaxJoints> jacobian =
      Eigen::Matrix<double, kMaxJoints, kMaxJoints>::Zero();
  JointVector velocity = JointVector::Zero();
  JointVector error = JointVector::Zero();  ///< what is still to go, in the same rows
  double gain = 0.0;  ///< 1/s; TwoTaskIk takes less where the arm could not brake
  /// true: near a singularity the task is rejected altogether, eq. (11). false: only the singular
  /// directions are, as a task with more rows than the null space has dimensions needs.
  bool reject_whole = true;
};

/// The second task of TwoTaskIk. Called in the control cycle: no allocation, no lock, no throw.
class SecondTask {
 public:
  virtual ~SecondTask() = default;
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
  void evaluate(const ChainState& state, const JointVector& q, const CartesianReference& reference,
                TaskConstraint& constraint) const noexcept override;

 private:
  double gain_;
};

/// Draws the joints towards a posture: another second task, in place of the orientation.
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
