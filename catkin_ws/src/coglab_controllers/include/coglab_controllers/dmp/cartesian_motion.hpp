/// @file
/// A whole Cartesian motion: estimator, DMP, orientation curve and end of the motion in the order
/// of the control cycle.
#pragma once

#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/dmp/motion_end.hpp"
#include "coglab_controllers/dmp/orientation_curve.hpp"
#include "coglab_controllers/goal/goal_estimator.hpp"
#include "coglab_controllers/goal/goal_jitter.hpp"

namespace coglab_controllers {

/// What execute_dmp asks for, checked and complete; built outside the cycle, copied into it.
struct CartesianMotionPlan {
  TransformationSystem system;
  double ratio = 1.0;  ///< dmp_ratio
  bool orientation_control = true;
  /// m/s at which the hand comes to the goal at last; 0: as the primitive has it.
  /// Within kSlowWay of the goal it is not faster, before that only so much that it brakes by
  /// kGentleBraking until there; the clock of the primitive is slowed for that, its path stays.
  double arrival_speed = 0.0;
  /// The goal tells where something will come to rest. It moves because the prediction changes,
  /// which is not followed like a goal that moves; see GoalEstimatorParameters::predicted_speed.
  bool predicted = false;
};

inline constexpr double kSlowWay = 0.02;         ///< m
inline constexpr double kGentleBraking = 0.6;    ///< m/s^2
inline constexpr double kFastestArrival = 0.45;  ///< m/s, on all of the way

/// Runs a primitive towards a goal pose that may move. This is all the DMP plug-in does between its
/// mailboxes and the IK; the Python module runs the same code. No allocation, no throw.
class CartesianMotion {
 public:
  enum class Phase {
    Idle,     ///< no motion was started
    Running,  ///< on the way
    Ended     ///< arrived; the goal is latched and the set-point rests
  };

  /// @throws std::invalid_argument as the constructors of the estimators and MotionEnd.
  CartesianMotion(const GoalEstimatorParameters& estimator = {},
                  const MotionEndParameters& end = {});

  /// Begins at phase 1 from the given pose and velocity (execute_dmp).
  /// @param goal hand pose to reach, offset and target orientation already applied, goal as
  /// received now.  @param approach as of step().
  void start(const CartesianMotionPlan& plan, const Pose& pose, const Vector3& velocity,
             const Vector3& angular_velocity, const Pose& goal,
             const Vector3& approach = Vector3::Zero()) noexcept;

  /// Another primitive or ratio (switch_dmp): phase, position and velocity are kept, and the
  /// orientation curve goes on from where it is.
  void switchTo(const CartesianMotionPlan& plan, const Pose& goal) noexcept;

  /// One cycle.
  /// @param goal as received, sample-and-hold.  @param rate 0..1 slows the clock (speed_scale), see
  /// Dmp::step.  @param approach m, along which the hand comes to the goal at last: until half of
  /// the motion is over the goal counts as drawn back by it, then less and less, at the end not at
  /// all.
  /// @return what the IK shall do in this cycle.
  const CartesianReference& step(double dt, const Pose& goal, double rate = 1.0,
                                 const Vector3& approach = Vector3::Zero()) noexcept;

  /// Ends the motion as reached at this pose, where the hand stands; a goal that leaves it by more
  /// than follow_distance is followed again.
  void endAt(const Pose& pose) noexcept;

  /// Ends the motion where it is; the set-point rests at the present one.
  void stop() noexcept;

  Phase phase() const noexcept { return phase_; }
  /// Of the last step.
  MotionEnd::Event event() const noexcept { return event_; }
  const Dmp& dmp() const noexcept { return dmp_; }
  const CartesianReference& reference() const noexcept { return reference_; }
  /// Goal position as used in eq. (1), m: the estimate, or the latched goal after the end.
  const Vector3& goal() const noexcept { return goal_; }
  /// Target orientation as estimated; it does not matter without orientation control.
  const Quaternion& goalOrientation() const noexcept {
    return orientation_estimator_.orientation();
  }
  /// Of the clock, 0..1, in the last step.
  double rate() const noexcept { return rate_; }
  /// Of the set-point, m/s, on the clock of speed_scale: slowed for a slow arrival alone.
  Vector3 velocity() const noexcept { return arrival_rate_ * dmp_.state().velocity; }
  /// From the set-point to the goal as received, m.
  double remainingDistance() const noexcept { return remaining_distance_; }
  /// Estimated from the phase and tau, s, at rate 1.
  double remainingTime() const noexcept {
    return phase_ == Phase::Running ? dmp_.remainingTime() : 0.0;
  }

 private:
  void watchNoise(double dt, const Pose& goal) noexcept;
  double arrivalRate(const Vector3& goal) const noexcept;

  GoalEstimator goal_estimator_;
  OrientationEstimator orientation_estimator_;
  Dmp dmp_;
  OrientationCurve curve_;
  MotionEnd end_;
  CartesianReference reference_;
  Phase phase_ = Phase::Idle;
  MotionEnd::Event event_ = MotionEnd::Event::None;
  GoalJitter jitter_{0.03}, turning_jitter_{0.3};
  Pose seen_;  // the goal as received in the last step
  Vector3 goal_ = Vector3::Zero();
  Quaternion orientation_ = Quaternion::Identity();  // set-point at the end of the last step
  double curve_begin_ = 0.0;                         // progress of the DMP at which the curve began
  double remaining_distance_ = 0.0;
  double rate_ = 1.0;           // of the last step
  double arrival_speed_ = 0.0;  // of the plan
  bool predicted_ = false;      // of the plan that it began with
  double arrival_rate_ = 1.0;   // share of the rate that it left in the last step
  double drawn_ = 1.0;          // share of the approach by which the goal was drawn back then
  bool settled_ = false;        // the set-point has come to rest at the latched goal
};

}  // namespace coglab_controllers
