/// @file
/// Slows the clock of a motion so that the reference waits for the arm.
#pragma once

namespace coglab_controllers {

/// Computes the `rate` of CartesianMotion::step, and of the profile time of a point-to-point
/// motion, from the speed scale and the scaling by limits. The rate rises, and follows the speed
/// scale, at a bounded speed, so the velocity makes no step. If limits have already slowed the
/// arm, the rate falls at once.
class PhaseGovernor {
 public:
  /// @param rise, fall largest change of the rate per second.  @throws std::invalid_argument unless
  /// positive.
  explicit PhaseGovernor(double rise = 2.0, double fall = 10.0);

  /// Resets for a new motion from rest. A motion that starts while moving begins with rate 1.
  void reset(double rate = 1.0) noexcept { rate_ = rate; }

  /// One cycle.
  /// @param speed_scale 0..1 as set by the user.
  /// @param limit_scale 0..1: scale that the limits imposed in the last cycle (IkResult::scale
  /// times GuardResult::scale).
  double update(double dt, double speed_scale, double limit_scale) noexcept;

  double rate() const noexcept { return rate_; }

 private:
  double rise_, fall_;
  double rate_ = 1.0;
};

}  // namespace coglab_controllers
