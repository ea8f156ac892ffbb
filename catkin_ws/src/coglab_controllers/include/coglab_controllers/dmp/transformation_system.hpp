/// @file
/// Eq. (1), (2), (4) and (5) of one primitive on three axes, in fixed-size form for the control
/// cycle. Notation: docs/architecture.md, the motion primitive.
#pragma once

#include "coglab_controllers/dmp/primitive.hpp"

namespace coglab_controllers {

/// A primitive ready to run: validated, fixed size, copied without allocation.
class TransformationSystem {
 public:
  /// The system at rest: no shape (phi = 0), K = 150, duration 1 s.
  TransformationSystem() noexcept;
  /// @throws std::invalid_argument if the primitive is not valid.
  explicit TransformationSystem(const Primitive& primitive);

  const CanonicalSystem& canonical() const noexcept { return canonical_; }
  double duration() const noexcept { return duration_; }    ///< s
  double stiffness() const noexcept { return stiffness_; }  ///< K
  double damping() const noexcept { return damping_; }      ///< D
  int basisCount() const noexcept { return count_; }  ///< N, rounded up to whole packets of four

  /// Turns and scales the learnt shape from the demonstration's start-goal line to this one
  /// (ShapeMapping).
  void mapShape(const Vector3& start, const Vector3& goal) noexcept;

  /// Start to goal of the demonstration, m.
  const Vector3& demonstratedLine() const noexcept { return demonstrated_line_; }

  /// w(s), 0 at the start and 1 at the end.
  double goalWeight(double s) const noexcept { return goal_weight_(s); }
  /// phi(s) of eq. (5), m relative to the start. Never divides by a vanishing sum.
  Vector3 movingPoint(double s) const noexcept;
  /// Weight of g' in h: the goal's own weight made smooth at both ends (w^2 (3 - 2 w)). With its
  /// full weight from the beginning an approaching goal would push the hand backward; with w
  /// itself a steadily moving goal would be met 20 % later (docs/deviations.md).
  static double velocityWeight(double w) noexcept { return w * w * (3.0 - 2.0 * w); }
  /// h(w, g, g') of eq. (4), given phi(s): the part that does not depend on the state.
  Vector3 forcing(double w, const Vector3& phi, const Vector3& start, const Vector3& goal,
                  const Vector3& goal_velocity, double tau) const noexcept {
    return (1.0 - w) * stiffness_ * (phi + start) + w * stiffness_ * goal +
           velocityWeight(w) * damping_ * tau * goal_velocity;
  }
  /// tau * v' of eq. (4).
  Vector3 acceleration(const Vector3& forcing, const Vector3& x, const Vector3& v) const noexcept {
    return forcing - stiffness_ * x - damping_ * v;
  }

 private:
  CanonicalSystem canonical_;
  double duration_, stiffness_, damping_;
  GoalWeight goal_weight_;
  ShapeMapping mapping_;
  Vector3 demonstrated_line_;
  Matrix3 shape_map_ = Matrix3::Identity();
  int count_;
  Eigen::Array<double, kMaxBasis, 1> centres_, widths_;
  Eigen::Array<double, kMaxBasis, 3> weights_;  // one column per axis, so that each is contiguous
};

}  // namespace coglab_controllers
