/// @file
/// From goals as received to the goal of eq. (1): g and g' without steps, without the lag of a
/// ramp, and without the noise of the tracker.
#pragma once

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// Parameters of GoalFilter.
struct GoalFilterParameters {
  double time_constant = 0.06;  ///< s; 0 switches the filter off: g is the input, g' is zero
  /// s; what it grows to when the goal is noisy; not below time_constant
  double noisy_time_constant = 0.10;
  /// The same for orientations: a tracker sees how an object is turned less well than where it is,
  /// and what the wrist does about that costs the acceleration that the way needs.
  double noisy_turning_time_constant = 0.30;
  /// m/s, rad/s: an estimated speed below this counts as noise when the noise is full
  double noisy_speed = 0.04;
  double noisy_turning = 2.0;
  /// m/s below which the speed of a predicted goal counts as a change of the prediction
  double predicted_speed = 0.08;
  /// m/s that g' has at most: a goal that is faster is a hand on its way, or a prediction that has
  /// changed, and will stop. It is neither led nor run after.
  double max_speed = 0.15;
  double max_innovation =
      0.15;  ///< m: a goal further away pulls no harder, which bounds speed and acceleration
  double max_angle_innovation = 0.6;  ///< rad, for orientations
};

/// Estimates goal position, velocity and orientation from goals as received (sample-and-hold
/// between frames).
///
/// Constant-velocity trackers of third order (three equal poles at 1/time_constant, solved exactly)
/// with ramp compensation: g = p + 3 T g', so a steadily moving goal is met without lag, and g and
/// g' have no step when the input has one. The noise is measured from the steps between frames: the
/// change of the change of three successive steps is nearly zero for what a person's hand does
/// between frames of 30 Hz (its jerk), and large for noise. g' is p', but as good as zero where the
/// goal is noisy and p' is no faster than the noise makes it: a goal that rests is not led by its
/// own noise. Nor is one led by the changes of a prediction, or by more than max_speed: a faster
/// goal is met only once it is slower. No allocation, no throw but in the constructor.
class GoalFilter {
 public:
  /// @throws std::invalid_argument unless time_constant is 0 or in [0.005, 2] and the others are
  /// positive.
  explicit GoalFilter(const GoalFilterParameters& parameters = {});

  /// A motion begins: at rest at `goal`, and no noise is known.
  void begin(const Pose& goal) noexcept;
  /// At rest at this position (m) or orientation; the noise stays known.
  void restAt(const Vector3& position) noexcept;
  void restAt(const Quaternion& orientation) noexcept;

  /// One cycle of `dt` s of the noise, with the newest goal as received.
  void measureNoise(double dt, const Pose& goal) noexcept;
  /// One cycle of `dt` s of the estimates, with the newest goal as received (finite).
  /// @param predicted the goal tells where something will come to rest, not where it is
  void update(double dt, const Pose& goal, bool predicted = false) noexcept;

  bool enabled() const noexcept { return parameters_.time_constant > 0.0; }
  const Vector3& position() const noexcept { return position_; }           ///< g, m
  const Vector3& velocity() const noexcept { return place_.velocity; }     ///< g', m/s
  const Quaternion& orientation() const noexcept { return orientation_; }  ///< of the target
  /// rad/s, base frame
  const Vector3& angularVelocity() const noexcept { return turn_.velocity; }
  /// 0: none, to 1: full, of position and orientation.
  double noise() const noexcept;
  double turningNoise() const noexcept;

 private:
  /// What position and orientation have in common. It works on the difference to the input, so
  /// that the same code tracks points and, in the tangent space, rotations.
  struct Track {
    double time_constant = 0.0;              // s, at present
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
