/// @file
/// A whole Cartesian motion: goal filter, DMP, orientation curve and end of the motion in the order
/// of the control cycle.
#pragma once

#include <vector>

#include "coglab_controllers/dmp/dmp_request.hpp"
#include "coglab_controllers/dmp/orientation_curve.hpp"
#include "coglab_controllers/goal/goal_filter.hpp"

namespace coglab_controllers {

/// When a motion is over, and when a goal that moves afterwards is followed again.
struct MotionEndParameters {
  double phase = 0.012;  ///< the phase must be below this (0.01 is reached with the duration over),
  double speed = 0.02;   ///< m/s, the set-point move slower than this,
  double turning = 0.2;  ///< rad/s, and turn slower than this,
  double distance = 0.005;         ///< m, and be closer to the goal than this
  double follow_distance = 0.030;  ///< m: a goal that leaves this ball around the latched one …
  double follow_time = 0.2;        ///< s: … for this long is followed again
};

/// Poses of the end-effector in order of time, and when it is there.
struct TimedPath {
  std::vector<double> times;  ///< s from now, growing, one for each pose
  std::vector<Pose> poses;    ///< m and unit quaternions
};
inline constexpr int kPathPoints = 40;  ///< a path has at most one pose more

/// The least speed of a clock that a prediction reckons with: one that stands has no end.
inline constexpr double kSlowestClock = 0.1;

inline constexpr double kSlowWay = 0.02;         ///< m
inline constexpr double kGentleBraking = 0.6;    ///< m/s^2
inline constexpr double kFastestArrival = 0.45;  ///< m/s, on all of the way

/// Runs a primitive towards a goal pose that may move. When it has arrived the goal is latched, so
/// that a noisy goal does not move an arm that stands. The Python module runs the same code. No
/// allocation, no throw but in the constructor and in rollOut().
class CartesianMotion {
 public:
  enum class Phase {
    Idle,     ///< no motion was started
    Running,  ///< on the way
    Ended     ///< arrived; the goal is latched and the set-point rests
  };

  enum class Event { None, Ended, FollowsAgain };

  /// @throws std::invalid_argument as the constructor of GoalFilter, or naming the parameter of the
  /// end that is not finite and positive.
  CartesianMotion(const GoalFilterParameters& filter = {}, const MotionEndParameters& end = {});

  /// Begins at phase 1 from the given pose and velocity (execute_dmp).
  /// @param goal hand pose to reach, offset and target orientation already applied, goal as
  /// received now.  @param approach as of step().
  void start(const DmpPlan& plan, const Pose& pose, const Vector3& velocity,
             const Vector3& angular_velocity, const Pose& goal,
             const Vector3& approach = Vector3::Zero()) noexcept;

  /// Another primitive or ratio (switch_dmp): phase, position and velocity are kept, and the
  /// orientation curve goes on from where it is.
  void switchTo(const DmpPlan& plan, const Pose& goal) noexcept;

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

  /// The set-points from where the motion is to its end, at most kPathPoints + 1, the first of them
  /// now; none if it is idle. Allocates: not for the control cycle.
  /// @param goal as received, taken to stay where it is
  /// @param rate 0..1 of the clock, taken to stay as well, kSlowestClock at least
  /// @param approach as of step()
  TimedPath rollOut(const Pose& goal, double rate = 1.0,
                    const Vector3& approach = Vector3::Zero()) const;

  Phase phase() const noexcept { return phase_; }
  /// Of the last step.
  Event event() const noexcept { return event_; }
  const Dmp& dmp() const noexcept { return dmp_; }
  const CartesianReference& reference() const noexcept { return reference_; }
  /// Goal position as used in eq. (1), m: the estimate, or the latched goal after the end.
  const Vector3& goal() const noexcept { return goal_; }
  /// Target orientation as estimated; it does not matter without orientation control.
  const Quaternion& goalOrientation() const noexcept { return filter_.orientation(); }
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
  double arrivalRate(const Vector3& goal) const noexcept;
  Event watchEnd(double dt, double speed, double turning, const Vector3& received) noexcept;

  MotionEndParameters end_;
  GoalFilter filter_;
  Dmp dmp_;
  OrientationCurve curve_;
  CartesianReference reference_;
  Phase phase_ = Phase::Idle;
  Event event_ = Event::None;
  Vector3 goal_ = Vector3::Zero();
  double away_ = 0.0;  // s that the goal has been outside the ball around the latched one
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
