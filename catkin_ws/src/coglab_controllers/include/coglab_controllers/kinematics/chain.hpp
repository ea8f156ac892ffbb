/// @file
/// Kinematic chain of the arm. KDL parses the URDF at load; the control cycle runs fixed-size code.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "coglab_controllers/kinematics/types.hpp"

namespace KDL {
class Chain;
}

namespace coglab_controllers {

/// Forward kinematics of one joint configuration; everything is in the base frame.
struct ChainState {
  Pose tool;                             ///< pose of the tip
  Jacobian jacobian = Jacobian::Zero();  ///< of the tip, eq. (8)
  Matrix37 axes = Matrix37::Zero();      ///< unit axis of each joint
  Matrix37 origins = Matrix37::Zero();   ///< m, a point on each joint's axis
};

/// A serial chain of 6 or 7 revolute joints from a base link to a tip link.
///
/// Only the constructor allocates or throws. Results equal those of KDL's solvers within 1e-12.
class Chain {
 public:
  /// Parses a URDF (the text, not a file name).
  /// @throws std::invalid_argument with the link or joint if the URDF does not parse, if no chain
  /// connects the links, or if it does not have 6 or 7 movable joints, all revolute or continuous.
  Chain(const std::string& urdf, const std::string& base_link, const std::string& tip_link);

  int joints() const noexcept { return joints_; }
  const std::vector<std::string>& jointNames() const noexcept { return joint_names_; }
  const std::string& baseLink() const noexcept { return base_link_; }

  /// Index of the joint whose origin is the elbow: the middle of the arm (3 of 7, 2 of 6).
  int elbowJoint() const noexcept { return joints_ == 7 ? 3 : 2; }
  /// Index of the joint whose origin is the wrist centre (5 of 7, 4 of 6).
  int wristJoint() const noexcept { return joints_ - 2; }
  /// Largest possible distance between shoulder (origin of joint 1) and wrist centre, m.
  double reach() const noexcept { return reach_; }

  /// Forward kinematics and Jacobian. Entries of `q` beyond joints() are ignored.
  void evaluate(const JointVector& q, ChainState& state) const noexcept;
  ChainState evaluate(const JointVector& q) const noexcept {
    ChainState state;
    evaluate(q, state);
    return state;
  }

  /// The same for a cycle of `dt` s in which the joints move at about `velocity` (rad/s). The pose
  /// is that at q. All other values are those at the middle of the cycle: with that Jacobian the
  /// pose at the end of the cycle has an error of third order in dt.
  void evaluate(const JointVector& q, const JointVector& velocity, double dt,
                ChainState& state) const noexcept;

  /// Velocity of the origin of joint `index` (elbow, wrist), m/s, base frame.
  static Vector3 originVelocity(const ChainState& state, int index,
                                const JointVector& velocity) noexcept;

  /// KDL's chain, for comparison in tests and benchmarks.
  const KDL::Chain& kdl() const noexcept { return *kdl_; }

 private:
  struct Link {
    Matrix3 rotation;     // fixed rotation before the joint's own rotation about z
    Vector3 translation;  // m
  };

  int joints_ = 0;
  double reach_ = 0.0;
  std::array<Link, kMaxJoints> links_;
  Link tool_;
  std::string base_link_;
  std::vector<std::string> joint_names_;
  std::shared_ptr<const KDL::Chain> kdl_;
};

}  // namespace coglab_controllers
