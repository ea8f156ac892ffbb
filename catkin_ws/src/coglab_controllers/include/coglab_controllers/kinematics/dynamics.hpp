/// @file
/// The arm's rigid-body terms for a momentum observer: KDL on the robot description.
#pragma once

#include <memory>
#include <string>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// kg m^2; one row and column per joint.
using MassMatrix = Eigen::Matrix<double, kMaxJoints, kMaxJoints>;

/// Terms of M(q) q'' + C(q, q') q' + g(q) = torque + external torque at one posture and velocity.
struct DynamicTerms {
  MassMatrix mass = MassMatrix::Zero();          ///< M, links only, without the motors
  JointVector momentum = JointVector::Zero();    ///< M q', kg m^2/s
  JointVector coriolis = JointVector::Zero();    ///< C q', Nm
  JointVector transposed = JointVector::Zero();  ///< C^T q', Nm: M' q' - C q'
  JointVector gravity = JointVector::Zero();     ///< g, Nm
};

/// An arm of 7 revolute joints with all that hangs on it (hand and fingers, with their joints at
/// zero) and a payload at its tip.
///
/// Not for the control cycle: KDL's solvers allocate.
class ArmDynamics {
 public:
  /// Parses a URDF (the text, not a file name); gravity is 9.81 m/s^2 against z of the base.
  /// @throws std::invalid_argument if it does not parse, has no such chain or not 7 joints in it.
  ArmDynamics(const std::string& urdf, const std::string& base_link, const std::string& tip_link);
  ~ArmDynamics();
  ArmDynamics(ArmDynamics&&) noexcept;
  ArmDynamics& operator=(ArmDynamics&&) noexcept;

  /// What the hand carries: a point of `mass` kg at `centre` (m, frame of the tip); 0 kg: nothing.
  /// @throws std::invalid_argument for a mass below 0 or a number that is not finite.
  void setPayload(double mass, const Vector3& centre);

  /// @param q   rad
  /// @param dq  rad/s
  /// @throws std::runtime_error where a solver of KDL refuses.
  DynamicTerms evaluate(const JointVector& q, const JointVector& dq);

 private:
  struct Solvers;
  std::unique_ptr<Solvers> solvers_;
};

}  // namespace coglab_controllers
