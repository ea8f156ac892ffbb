/// @file
/// When a motion is over, and when a goal that moves afterwards is followed again.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Thresholds of MotionEnd.
struct MotionEndParameters {
  double phase = 0.012;  ///< the phase must be below this (0.01 is reached with the duration over),
  double speed = 0.02;   ///< m/s, the set-point move slower than this,
  double turning = 0.2;  ///< rad/s, and turn slower than this,
  double distance = 0.005;         ///< m, and be closer to the goal than this
  double follow_distance = 0.030;  ///< m: a goal that leaves this ball around the latched one …
  double follow_time = 0.2;        ///< s: … for this long is followed again
};

/// Latches the goal when a motion has ended, so that a noisy goal does not move an arm that has
/// arrived.
class MotionEnd {
 public:
  enum class Event { None, Ended, FollowsAgain };

  /// @throws std::invalid_argument naming the parameter that is not finite and positive.
  explicit MotionEnd(const MotionEndParameters& parameters = {});

  void reset() noexcept;  ///< a new motion begins

  /// One cycle.
  /// @param speed, turning of the set-point, m/s and rad/s.  @param position of the set-point, m.
  /// @param goal as estimated, m.  @param raw_goal as received, m.
  Event update(double dt, double phase, double speed, double turning, const Vector3& position,
               const Vector3& goal, const Vector3& raw_goal) noexcept;

  /// The motion has ended at this goal, m.
  void latch(const Vector3& goal) noexcept {
    latched_ = true;
    goal_ = goal;
    away_ = 0.0;
  }
  bool latched() const noexcept { return latched_; }
  const Vector3& latchedGoal() const noexcept { return goal_; }  ///< m, if latched()

 private:
  MotionEndParameters parameters_;
  bool latched_ = false;
  Vector3 goal_ = Vector3::Zero();
  double away_ = 0.0;  // s the goal has been outside the ball
};

}  // namespace coglab_controllers
