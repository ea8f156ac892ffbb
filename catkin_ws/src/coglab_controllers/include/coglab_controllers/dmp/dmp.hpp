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

/// A validated primitive and its running motion. It has a fixed size and is copied without
/// allocation. Fourth-order Runge-Kutta integrates it, in sub-steps if the cycle is long. Only the
/// constructor from a primitive allocates or throws.
class Dmp {
 public:
  /// A primitive at rest: no shape (phi = 0), K = 150, duration 1 s.
  Dmp() noexcept;
  /// @throws std::invalid_argument if the primitive is not valid.
  explicit Dmp(const Primitive& primitive);

  /// Begins a motion at phase 1.
  /// @param goal m, used only for the primitive's ShapeMapping
  /// @param ratio dmp_ratio, tau = ratio * duration. The caller checks it with `requireRatio`.
  void start(const Vector3& position, const Vector3& velocity, const Vector3& goal,
             double ratio) noexcept;

  /// Changes to the primitive of `other`, or to another ratio, during the motion. Phase, position
  /// and velocity are kept.
  void switchTo(const Dmp& other, const Vector3& goal, double ratio) noexcept;

  /// Changes the time constant; position, velocity and phase are kept.
  void setRatio(double ratio) noexcept;

  /// Ends the motion at rest at this position, m.
  void endAt(const Vector3& position) noexcept;

  /// One cycle.
  /// @param dt s; a step of 0 changes nothing.
  /// @param goal, goal_velocity g (m) and g' (m/s) of eq. (1), g at the beginning of the cycle.
  /// @param rate 0..1, clock rate: the path stays the same, and time along it runs `rate` times as
  /// fast (0: standstill). The velocity in state() is x' at rate 1; the arm moves at rate * x'.
  const DmpState& step(double dt, const Vector3& goal,
                       const Vector3& goal_velocity = Vector3::Zero(), double rate = 1.0) noexcept;

  const DmpState& state() const noexcept { return state_; }
  const Vector3& startPosition() const noexcept { return start_; }  ///< x0, m
  double tau() const noexcept { return tau_; }                      ///< s
  double ratio() const noexcept { return tau_ / shape_.duration; }
  /// Share of the motion's duration that has passed, 0..1.
  double progress() const noexcept;
  /// Time until the duration is over, s, at rate 1.
  double remainingTime() const noexcept;

  /// @name The primitive, eq. (1), (2), (4) and (5). Notation: docs/equations.md
  /// @{
  double duration() const noexcept { return shape_.duration; }    ///< s
  double stiffness() const noexcept { return shape_.stiffness; }  ///< K
  double damping() const noexcept { return shape_.damping; }      ///< D
  /// Vector from start to goal of the demonstration, m.
  const Vector3& demonstratedLine() const noexcept { return shape_.demonstrated_line; }
  /// w(s), 0 at the start and 1 at the end.
  double goalWeight(double s) const noexcept { return shape_.goal_weight(s); }
  /// phi(s) of eq. (5), m, relative to the start. Safe where the sum of the basis vanishes.
  Vector3 movingPoint(double s) const noexcept;
  /// Weight of g' in h: the weight w of the goal, smooth at both ends (w^2 (3 - 2 w)). With full
  /// weight from the beginning, an approaching goal would push the hand backward. With w itself,
  /// the hand would meet a steadily moving goal 20 % later (docs/deviations.md).
  static double velocityWeight(double w) noexcept { return w * w * (3.0 - 2.0 * w); }
  /// h(w, g, g') of eq. (4) for a given phi(s). It does not depend on the state.
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
  /// The learnt parameters.
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
  Matrix3 shape_map_ = Matrix3::Identity();  // from the demonstrated line to the present one
  DmpState state_;
  Vector3 start_ = Vector3::Zero();
  Vector3 phi_ = Vector3::Zero();  // moving point at the current phase
  double tau_ = 1.0;
};

/// @throws std::invalid_argument unless 0.05 <= ratio <= 100; the message states the range.
void requireRatio(double ratio);

}  // namespace coglab_controllers
