/// @file
/// The one estimator every goal passes before eq. (1): position g and velocity g' without steps and
/// without ramp lag.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Third-order tracker shared by goal position and orientation: three equal poles at
/// 1/time_constant, solved exactly.
///
/// It works on the difference to its input, so that the same code tracks points and, in the tangent
/// space, rotations.
struct ThirdOrderTracker {
  Vector3 rate = Vector3::Zero();          ///< per second
  Vector3 acceleration = Vector3::Zero();  ///< per second^2

  /// One step towards an input that stays `error` away from the present value; returns the change
  /// of the value.
  Vector3 advance(const Vector3& error, double dt, double time_constant) noexcept;
};

/// Parameters of both estimators.
struct GoalEstimatorParameters {
  double time_constant = 0.06;  ///< s; 0 switches the estimator off: g is the input, g' is zero
  /// s; what it grows to when the goal trembles, see GoalJitter; not below time_constant
  double noisy_time_constant = 0.10;
  /// The same for orientations: a tracker sees how an object is turned less well than where it is,
  /// and what the wrist does about that costs the acceleration that the way needs.
  double noisy_turning_time_constant = 0.30;
  /// m/s, rad/s: an estimated speed below this is taken for noise when the goal trembles fully
  double noisy_speed = 0.04;
  double noisy_turning = 2.0;
  /// m/s below which the speed of a predicted goal is taken for a change of the prediction
  double predicted_speed = 0.08;
  /// m/s that g' has at most: a goal that is faster is a hand on its way, or a prediction that has
  /// changed, and will stop. It is neither led nor run after.
  double max_speed = 0.15;
  double max_innovation =
      0.15;  ///< m: a goal further away pulls no harder, which bounds speed and acceleration
  double max_angle_innovation = 0.6;  ///< rad, for orientations
};

/// Estimates g and g' from goal positions as received (sample-and-hold between frames).
///
/// A constant-velocity tracker of third order with ramp compensation: g = p + 3 T g', so a steadily
/// moving goal is met without lag, and g and g' have no step when the input has one. g' is p', but
/// as good as zero where the goal trembles and p' is no faster than the trembling makes it: a goal
/// that rests is then not led by its own noise. Nor is one led by the changes of a prediction, or
/// by more than max_speed: a faster goal is met only once it is slower. No allocation, no throw.
class GoalEstimator {
 public:
  /// @throws std::invalid_argument unless time_constant is 0 or in [0.005, 2] and the others are
  /// positive.
  explicit GoalEstimator(const GoalEstimatorParameters& parameters = {});

  /// At rest at `goal` (m).
  void reset(const Vector3& goal) noexcept;
  /// One cycle of `dt` s with the newest goal as received (m, finite).  @param noise of it, 0..1.
  /// @param predicted it tells where something will come to rest, not where it is
  void update(double dt, const Vector3& goal, double noise = 0.0, bool predicted = false) noexcept;

  const Vector3& position() const noexcept { return position_; }  ///< g, m
  const Vector3& velocity() const noexcept { return velocity_; }  ///< g', m/s
  bool enabled() const noexcept { return parameters_.time_constant > 0.0; }

 private:
  GoalEstimatorParameters parameters_;
  ThirdOrderTracker tracker_;
  double time_constant_ = 0.0;  // s, at present
  Vector3 smooth_ = Vector3::Zero();
  Vector3 position_ = Vector3::Zero(), velocity_ = Vector3::Zero();
};

/// The same for the target orientation of a turning object.
class OrientationEstimator {
 public:
  /// @throws std::invalid_argument as GoalEstimator.
  explicit OrientationEstimator(const GoalEstimatorParameters& parameters = {});

  void reset(const Quaternion& target) noexcept;
  /// @param target unit; q and -q mean the same.  @param noise of it, 0..1.
  void update(double dt, const Quaternion& target, double noise = 0.0) noexcept;

  const Quaternion& orientation() const noexcept { return orientation_; }
  const Vector3& angularVelocity() const noexcept { return velocity_; }  ///< rad/s, base frame

 private:
  GoalEstimatorParameters parameters_;
  ThirdOrderTracker tracker_;
  double time_constant_ = 0.0;  // s, at present
  Quaternion smooth_ = Quaternion::Identity();
  Quaternion orientation_ = Quaternion::Identity();
  Vector3 velocity_ = Vector3::Zero();
};

}  // namespace coglab_controllers
