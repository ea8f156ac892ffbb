/// @file
/// A complete Cartesian motion. Each cycle runs the goal filter, the DMP, the orientation curve and
/// the check for the end of the motion.
#pragma once

#include <vector>

#include "coglab_controllers/dmp/dmp_request.hpp"
#include "coglab_controllers/dmp/orientation_curve.hpp"
#include "coglab_controllers/goal/goal_filter.hpp"

namespace coglab_controllers {

/// Conditions for the end of a motion (all four), and for following a goal that moves afterwards.
struct MotionEndParameters {
  double phase = 0.012;            ///< largest phase (it is 0.01 when the duration is over)
  double speed = 0.02;             ///< m/s, largest speed of the set-point
  double turning = 0.2;            ///< rad/s, largest angular speed of the set-point
  double distance = 0.005;         ///< m, largest distance from the goal
  double follow_distance = 0.030;  ///< m: a goal that leaves this ball around the latched one …
  double follow_time = 0.2;        ///< s: … for this long is followed again
};

/// Poses of the end-effector with their times, in order of time.
struct TimedPath {
  std::vector<double> times;  ///< s from now, increasing, one for each pose
  std::vector<Pose> poses;    ///< m and unit quaternions
};
inline constexpr int kPathPoints = 40;  ///< a path has at most kPathPoints + 1 poses

/// Smallest clock rate (0..1) in a prediction. With a stopped clock a motion would never end.
inline constexpr double kSlowestClock = 0.1;

inline constexpr double kSlowWay = 0.02;         ///< m, final way at arrival_speed
inline constexpr double kGentleBraking = 0.6;    ///< m/s^2, braking before it
inline constexpr double kFastestArrival = 0.45;  ///< m/s, limit on the whole way with arrival_speed

/// Runs a primitive towards a goal pose that may move. On arrival the goal is latched, so that a
/// noisy goal does not move an arm that stands. The Python module runs the same code. Only the
/// constructor and rollOut() allocate or throw.
class CartesianMotion {
 public:
  enum class Phase {
    Idle,     ///< no motion was started
    Running,  ///< on the way
    Ended     ///< arrived; the goal is latched and the set-point rests
  };

  enum class Event { None, Ended, FollowsAgain };

  /// @throws std::invalid_argument as GoalFilter does, or if a parameter of `end` is not finite and
  /// positive (the message names it).
  CartesianMotion(const GoalFilterParameters& filter = {}, const MotionEndParameters& end = {});

  /// Begins at phase 1 from the given pose and velocity (execute_dmp).
  /// @param goal goal pose of the hand from the goal as received now; offset and target orientation
  /// are already applied.  @param approach see step().
  void start(const DmpPlan& plan, const Pose& pose, const Vector3& velocity,
             const Vector3& angular_velocity, const Pose& goal,
             const Vector3& approach = Vector3::Zero()) noexcept;

  /// Changes the primitive or the ratio (switch_dmp). Phase, position and velocity are kept. The
  /// orientation curve continues from the present orientation.
  void switchTo(const DmpPlan& plan, const Pose& goal) noexcept;

  /// One cycle.
  /// @param goal as received, sample-and-hold.  @param rate 0..1 slows the clock (speed_scale), see
  /// Dmp::step.  @param approach vector of the final approach, m. During the first half of the
  /// motion the goal is shifted back by this vector. The shift then decreases to zero at the end.
  /// @return reference for the IK in this cycle.
  const CartesianReference& step(double dt, const Pose& goal, double rate = 1.0,
                                 const Vector3& approach = Vector3::Zero()) noexcept;

  /// Changes how the goal is followed; see GoalFilter::setTracking. No effect on a filter that is
  /// off.
  void setTracking(double time_constant, double noisy_time_constant, double max_speed) noexcept {
    if (filter_.enabled()) {
      filter_.setTracking(time_constant, noisy_time_constant, max_speed);
    }
  }

  /// Ends the motion as reached at this pose, the present one of the hand. A goal that moves away
  /// from it by more than follow_distance is followed again.
  void endAt(const Pose& pose) noexcept;

  /// Ends the motion; the set-point rests at its present pose.
  void stop() noexcept;

  /// Predicted set-points from now to the end of the motion, at most kPathPoints + 1; none if idle.
  /// Allocates: not for the control cycle.
  /// @param goal as received, assumed constant
  /// @param rate clock rate 0..1, assumed constant; raised to kSlowestClock if lower
  /// @param approach see step()
  TimedPath rollOut(const Pose& goal, double rate = 1.0,
                    const Vector3& approach = Vector3::Zero()) const;

  Phase phase() const noexcept { return phase_; }
  /// Event of the last step.
  Event event() const noexcept { return event_; }
  const Dmp& dmp() const noexcept { return dmp_; }
  const CartesianReference& reference() const noexcept { return reference_; }
  /// Goal position as used in eq. (1), m: the estimate, or the latched goal after the end.
  const Vector3& goal() const noexcept { return goal_; }
  /// Estimated target orientation; unused without orientation control.
  const Quaternion& goalOrientation() const noexcept { return filter_.orientation(); }
  /// Clock rate in the last step, 0..1.
  double rate() const noexcept { return rate_; }
  /// Velocity of the set-point, m/s. It includes the slow arrival, but not speed_scale.
  Vector3 velocity() const noexcept { return arrival_rate_ * dmp_.state().velocity; }
  /// Distance from the set-point to the goal as received, m.
  double remainingDistance() const noexcept { return remaining_distance_; }
  /// Remaining time at rate 1, s, from the phase and tau.
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
  double away_ = 0.0;  // s, time of the goal outside the ball around the latched one
  Quaternion orientation_ = Quaternion::Identity();  // set-point at the end of the last step
  double curve_begin_ = 0.0;                         // progress of the DMP at which the curve began
  double remaining_distance_ = 0.0;
  double rate_ = 1.0;           // of the last step
  double arrival_speed_ = 0.0;  // of the plan
  bool predicted_ = false;      // of the plan at the start
  double arrival_rate_ = 1.0;   // factor 0..1 on the clock for a slow arrival, last step
  double drawn_ = 1.0;          // share of the approach by which the goal was shifted, last step
  bool settled_ = false;        // the set-point has come to rest at the latched goal
};

}  // namespace coglab_controllers
