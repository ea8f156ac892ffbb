/// @file
/// A running dynamic movement primitive: three Cartesian axes on one phase, eq. (1)-(5).
#pragma once

#include "coglab_controllers/dmp/transformation_system.hpp"

namespace coglab_controllers {

/// State of a running primitive.
struct DmpState {
  Vector3 position = Vector3::Zero();      ///< x, m
  Vector3 velocity = Vector3::Zero();      ///< x', m/s
  Vector3 acceleration = Vector3::Zero();  ///< x'', m/s^2, at the end of the last step
  double phase = 0.0;                      ///< s, 1 at the start of the motion
};

/// Integrates a primitive with fourth-order Runge-Kutta, in sub-steps if the cycle is long. No
/// allocation, no throw.
class Dmp {
 public:
  /// Begins a motion at phase 1. `ratio` is dmp_ratio: tau = ratio * duration; finite and positive
  /// (checked by the caller at plan time with `requireRatio`). `goal` only serves the primitive's
  /// ShapeMapping.
  void start(const TransformationSystem& system, const Vector3& position, const Vector3& velocity,
             const Vector3& goal, double ratio) noexcept;

  /// Another primitive (or the same with another ratio) in mid-motion: phase, position and velocity
  /// are kept.
  void switchTo(const TransformationSystem& system, const Vector3& goal, double ratio) noexcept;

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
  double ratio() const noexcept { return tau_ / system_.duration(); }
  /// Share of the motion's duration that has passed, 0..1.
  double progress() const noexcept;
  /// Until the duration is over, s, at rate 1.
  double remainingTime() const noexcept;
  const TransformationSystem& system() const noexcept { return system_; }

 private:
  TransformationSystem system_;
  DmpState state_;
  Vector3 start_ = Vector3::Zero();
  Vector3 phi_ = Vector3::Zero();  // moving point at the current phase
  double tau_ = 1.0;
};

/// @throws std::invalid_argument unless 0.05 <= ratio <= 100, saying so.
void requireRatio(double ratio);

}  // namespace coglab_controllers
