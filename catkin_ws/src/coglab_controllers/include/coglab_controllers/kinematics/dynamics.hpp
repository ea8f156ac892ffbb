/// @file
/// Rigid-body terms of the arm for a momentum observer, computed by KDL from the URDF.
#pragma once

#include <memory>
#include <string>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Mass matrix, kg m^2; one row and one column per joint.
using MassMatrix = Eigen::Matrix<double, kMaxJoints, kMaxJoints>;

/// Terms of M(q) q'' + C(q, q') q' + g(q) = torque + external torque at one posture and velocity.
struct DynamicTerms {
  MassMatrix mass = MassMatrix::Zero();          ///< M, links only, without the motors
  JointVector momentum = JointVector::Zero();    ///< M q', kg m^2/s
  JointVector coriolis = JointVector::Zero();    ///< C q', Nm
  JointVector transposed = JointVector::Zero();  ///< C^T q', Nm: M' q' - C q'
  JointVector gravity = JointVector::Zero();     ///< g, Nm
};

/// Dynamics of an arm of 7 revolute joints with hand and fingers (their joints at zero) and a
/// payload at its tip.
///
/// Not for the control cycle: KDL's solvers allocate.
class ArmDynamics {
 public:
  /// Parses a URDF (the text, not a file name). Gravity is 9.81 m/s^2 along -z of the base.
  /// @throws std::invalid_argument if it does not parse or has no such chain of 7 joints.
  ArmDynamics(const std::string& urdf, const std::string& base_link, const std::string& tip_link);
  ~ArmDynamics();
  ArmDynamics(ArmDynamics&&) noexcept;
  ArmDynamics& operator=(ArmDynamics&&) noexcept;

  /// Sets the payload: a point of `mass` kg at `centre` (m, frame of the tip). 0 kg: no payload.
  /// @throws std::invalid_argument for a mass below 0 or a number that is not finite.
  void setPayload(double mass, const Vector3& centre);

  /// @param q   rad
  /// @param dq  rad/s
  /// @throws std::runtime_error if a solver of KDL fails.
  DynamicTerms evaluate(const JointVector& q, const JointVector& dq);

 private:
  struct Solvers;
  std::unique_ptr<Solvers> solvers_;
};

}  // namespace coglab_controllers
