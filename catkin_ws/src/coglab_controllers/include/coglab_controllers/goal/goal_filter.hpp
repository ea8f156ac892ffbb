/// @file
/// Estimates the goal of eq. (1) from received goals: g and g' without steps, without lag on a
/// ramp, and with less tracker noise.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Parameters of GoalFilter.
struct GoalFilterParameters {
  double time_constant = 0.06;  ///< s; 0 switches the filter off: g is the input, g' is zero
  /// s, time constant at full noise; not below time_constant
  double noisy_time_constant = 0.10;
  /// s, the same for orientations. A tracker measures orientation less well than position, and the
  /// wrist would use up acceleration that the translation needs.
  double noisy_turning_time_constant = 0.30;
  /// m/s and rad/s: at full noise, a lower estimated speed counts as noise
  double noisy_speed = 0.04;
  double noisy_turning = 2.0;
  /// m/s: a lower speed of a predicted goal counts as a change of the prediction
  double predicted_speed = 0.08;
  /// m/s, largest g'. A faster goal is a hand in transit or a changed prediction. It will stop, so
  /// the arm does not follow it at full speed.
  double max_speed = 0.15;
  double max_innovation =
      0.15;  ///< m: larger differences to the input are clipped: bounds speed and acceleration
  double max_angle_innovation = 0.6;  ///< rad, the same for orientations
};

/// Estimates goal position, velocity and orientation from goals as received (sample-and-hold
/// between frames).
///
/// Third-order constant-velocity trackers (three equal poles at 1/time_constant, solved exactly)
/// with ramp compensation g = p + 3 T g'. So a steadily moving goal is met without lag, and a step
/// of the input makes no step of g or g'.
///
/// The noise is measured from the second difference of three successive steps between frames. It is
/// nearly zero for a person's hand at 30 Hz (its jerk), and large for noise.
///
/// g' is p', but nearly zero if p' is no faster than the noise or the changes of a prediction. It
/// is at most max_speed: a faster goal is met only once it slows down. Only the constructor
/// allocates or throws.
class GoalFilter {
 public:
  /// @throws std::invalid_argument unless time_constant is 0 or in [0.005, 2] and the others are
  /// positive.
  explicit GoalFilter(const GoalFilterParameters& parameters = {});

  /// Starts a motion: at rest at `goal`, with the noise estimate cleared.
  void begin(const Pose& goal) noexcept;
  /// Sets the estimate to rest at this position (m) or orientation. The noise estimate is kept.
  void restAt(const Vector3& position) noexcept;
  void restAt(const Quaternion& orientation) noexcept;

  /// Updates the noise estimate, once per cycle of `dt` s, with the newest goal as received.
  void measureNoise(double dt, const Pose& goal) noexcept;
  /// Updates the goal estimate, once per cycle of `dt` s, with the newest goal as received
  /// (finite).
  /// @param predicted true: the goal is a predicted rest position, not a present one
  void update(double dt, const Pose& goal, bool predicted = false) noexcept;

  /// Changes the time constants (s, 0.005 to 2) of an enabled filter and the largest g' (m/s),
  /// between two cycles. The estimate goes over to them without a step.
  void setTracking(double time_constant, double noisy_time_constant, double max_speed) noexcept {
    parameters_.time_constant = time_constant;
    parameters_.noisy_time_constant = noisy_time_constant;
    parameters_.max_speed = max_speed;
  }

  bool enabled() const noexcept { return parameters_.time_constant > 0.0; }
  const Vector3& position() const noexcept { return position_; }           ///< g, m
  const Vector3& velocity() const noexcept { return place_.velocity; }     ///< g', m/s
  const Quaternion& orientation() const noexcept { return orientation_; }  ///< of the target
  /// rad/s, base frame
  const Vector3& angularVelocity() const noexcept { return turn_.velocity; }
  /// Noise of position and of orientation, from 0 (none) to 1 (full).
  double noise() const noexcept;
  double turningNoise() const noexcept;

 private:
  /// Tracker for position or orientation. It works on the difference to the input, so the same code
  /// tracks points and, in the tangent space, rotations.
  struct Track {
    double time_constant = 0.0;              // s, current value
    Vector3 rate = Vector3::Zero();          // per second
    Vector3 acceleration = Vector3::Zero();  // per second^2
    Vector3 velocity = Vector3::Zero();      // the part of the rate that is not noise
    Vector3 last_step = Vector3::Zero(), step_before = Vector3::Zero();  // between frames
    int steps = 0;
    double noise_power = 0.0;  // squared steps of noise per second

    void rest(double time_constant) noexcept;
    Vector3 advance(const Vector3& error, double dt) noexcept;
    void wait(double dt) noexcept;
    void see(double dt, const Vector3& step, double full) noexcept;
    double noise(double full) const noexcept;
  };

  void adaptTimeConstant(Track& track, double noisy, double noise, double dt) const noexcept;

  GoalFilterParameters parameters_;
  Track place_, turn_;
  Pose seen_;  // the goal as received in the last cycle
  Vector3 smooth_ = Vector3::Zero(), position_ = Vector3::Zero();
  Quaternion smooth_turn_ = Quaternion::Identity(), orientation_ = Quaternion::Identity();
};

}  // namespace coglab_controllers
