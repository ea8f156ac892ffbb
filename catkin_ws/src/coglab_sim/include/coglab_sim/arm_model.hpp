/// @file
/// Kinematics and rigid-body terms of the arm with its hand. KDL computes them from the URDF.
#pragma once

#include <array>
#include <string>

#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim {

/// Kinematics and dynamics at one joint configuration.
struct ArmTerms {
  Matrix7 mass;       ///< link side, kg m^2
  Vector7 coriolis;   ///< C(q, dq) dq, Nm
  Vector7 gravity;    ///< torque that holds the arm against gravity, Nm
  Matrix67 jacobian;  ///< of the tip, world axes: rows x y z, rx ry rz
  Pose tip;           ///< ih2_palm in the world
};

/// Factors by which a model differs from the robot description; 1 is exact.
struct ModelErrors {
  double payload = 1.0;  ///< on the mass of all links fixed behind the last joint
  std::array<double, 7> inertia = {1, 1, 1, 1, 1, 1, 1};  ///< on the inertias of the moving links
};

/// Rigid-body model between two links of a URDF with seven joints in between.
///
/// Links beside the chain (fingers) add their mass, with their joints at zero. Links behind fixed
/// joints are merged, so that the recursion has seven bodies.
class ArmModel {
 public:
  /// @param urdf  path of the robot description
  /// @throws std::runtime_error naming file and link if the chain cannot be built or has not
  /// exactly seven joints.
  explicit ArmModel(const std::string& urdf, const ModelErrors& errors = {},
                    const std::string& base = "lwr_base_link", const std::string& tip = "ih2_palm");
  ArmModel(const ArmModel&) = delete;
  ArmModel& operator=(const ArmModel&) = delete;

  /// Fills `terms` for joint positions (rad) and velocities (rad/s). Allocates nothing.
  void evaluate(const Vector7& position, const Vector7& velocity, ArmTerms& terms);
  /// The two halves of evaluate(): mass, coriolis and gravity; jacobian and tip.
  void evaluateDynamics(const Vector7& position, const Vector7& velocity, ArmTerms& terms);
  void evaluateKinematics(const Vector7& position, ArmTerms& terms);

 private:
  KDL::Chain chain_;
  KDL::ChainDynParam dynamics_;
  KDL::ChainFkSolverPos_recursive forward_;
  KDL::ChainJntToJacSolver jacobian_solver_;
  KDL::JntArray q_, dq_, coriolis_, gravity_;
  KDL::JntSpaceInertiaMatrix mass_;
  KDL::Jacobian jacobian_;
};

}  // namespace coglab_sim
