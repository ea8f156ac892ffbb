/// @file
/// A running dynamic movement primitive: three Cartesian axes on one phase, eq. (1)-(5).
#pragma once

#include "coglab_controllers/dmp/primitive.hpp"

namespace coglab_controllers {

/// State of a running primitive.
struct DmpState {
  Vector3 position = Vector3::Zero();      ///< x, m
  Vector3 velocity = Vector3::Zero();      ///< x', m/s
  Vector3 acceleration = Vector3::Zero();  ///< x'', m/s^2, at the end of the last step
  double phase = 0.0;                      ///< s, 1 at the start of the motion
};

/// A primitive ready to run, and the motion that it makes: validated, fixed size, copied without
/// allocation. Integrated by fourth-order Runge-Kutta, in sub-steps if the cycle is long. Nothing
/// but the constructor from a primitive allocates or throws.
class Dmp {
 public:
  /// At rest: no shape (phi = 0), K = 150, duration 1 s.
  Dmp() noexcept;
  /// @throws std::invalid_argument if the primitive is not valid.
  explicit Dmp(const Primitive& primitive);

  /// Begins a motion at phase 1. `ratio` is dmp_ratio: tau = ratio * duration; finite and positive
  /// (checked by the caller at plan time with `requireRatio`). `goal` only serves the primitive's
  /// ShapeMapping.
  void start(const Vector3& position, const Vector3& velocity, const Vector3& goal,
             double ratio) noexcept;

  /// The primitive of `other` (or the same with another ratio) in mid-motion: phase, position and
  /// velocity are kept.
  void switchTo(const Dmp& other, const Vector3& goal, double ratio) noexcept;

  /// Another time constant; position, velocity and phase are kept.
  void setRatio(double ratio) noexcept;

  /// The motion has ended, and rests here.
  void endAt(const Vector3& position) noexcept;

  /// One cycle.
  /// @param dt s; a step of 0 changes nothing.
  /// @param goal, goal_velocity g (m) and g' (m/s) of eq. (1), g at the beginning of the cycle.
  /// @param rate 0..1, slows the clock: the path stays, the time along it runs `rate` times as fast
  /// (0: standstill).
  ///        The velocity in state() is x' of the unslowed motion; the arm moves at rate times it.
  const DmpState& step(double dt, const Vector3& goal,
                       const Vector3& goal_velocity = Vector3::Zero(), double rate = 1.0) noexcept;

  const DmpState& state() const noexcept { return state_; }
  const Vector3& startPosition() const noexcept { return start_; }  ///< x0, m
  double tau() const noexcept { return tau_; }                      ///< s
  double ratio() const noexcept { return tau_ / shape_.duration; }
  /// Share of the motion's duration that has passed, 0..1.
  double progress() const noexcept;
  /// Until the duration is over, s, at rate 1.
  double remainingTime() const noexcept;

  /// @name The primitive, eq. (1), (2), (4) and (5). Notation: docs/architecture.md
  /// @{
  double duration() const noexcept { return shape_.duration; }    ///< s
  double stiffness() const noexcept { return shape_.stiffness; }  ///< K
  double damping() const noexcept { return shape_.damping; }      ///< D
  /// Start to goal of the demonstration, m.
  const Vector3& demonstratedLine() const noexcept { return shape_.demonstrated_line; }
  /// w(s), 0 at the start and 1 at the end.
  double goalWeight(double s) const noexcept { return shape_.goal_weight(s); }
  /// phi(s) of eq. (5), m relative to the start. Never divides by a vanishing sum.
  Vector3 movingPoint(double s) const noexcept;
  /// Weight of g' in h: the goal's own weight made smooth at both ends (w^2 (3 - 2 w)). With its
  /// full weight from the beginning an approaching goal would push the hand backward; with w
  /// itself a steadily moving goal would be met 20 % later (docs/deviations.md).
  static double velocityWeight(double w) noexcept { return w * w * (3.0 - 2.0 * w); }
  /// h(w, g, g') of eq. (4), given phi(s): the part that does not depend on the state.
  Vector3 forcing(double w, const Vector3& phi, const Vector3& start, const Vector3& goal,
                  const Vector3& goal_velocity, double tau) const noexcept {
    return (1.0 - w) * stiffness() * (phi + start) + w * stiffness() * goal +
           velocityWeight(w) * damping() * tau * goal_velocity;
  }
  /// tau * v' of eq. (4).
  Vector3 acceleration(const Vector3& forcing, const Vector3& x, const Vector3& v) const noexcept {
    return forcing - stiffness() * x - damping() * v;
  }
  /// @}

 private:
  /// What was learnt.
  struct Shape {
    CanonicalSystem canonical;
    double duration = 1.0, stiffness = 150.0, damping = 24.494897427831781;
    GoalWeight goal_weight;
    ShapeMapping mapping = ShapeMapping::None;
    Vector3 demonstrated_line = Vector3::Zero();
    int count = 4;  // N, rounded up to whole packets
    Eigen::Array<double, kMaxBasis, 1> centres, widths;
    Eigen::Array<double, kMaxBasis, 3> weights;  // one column per axis, each contiguous
  };

  void mapShape(const Vector3& goal) noexcept;

  Shape shape_;
  Matrix3 shape_map_ = Matrix3::Identity();  // from the demonstration's line to this one
  DmpState state_;
  Vector3 start_ = Vector3::Zero();
  Vector3 phi_ = Vector3::Zero();  // moving point at the current phase
  double tau_ = 1.0;
};

/// @throws std::invalid_argument unless 0.05 <= ratio <= 100, saying so.
void requireRatio(double ratio);

}  // namespace coglab_controllers
