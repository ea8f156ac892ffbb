/// @file
/// The clock of a motion: tau * s' = -alpha * s, eq. (3).
#pragma once

namespace coglab_controllers {

/// Phase that falls from 1 at the start of a motion towards 0. Solved exactly, so that the step
/// size does not matter.
class CanonicalSystem {
 public:
  /// ln(100): the phase is 0.01 when the duration of the demonstration is over.
  static constexpr double kDefaultAlpha = 4.605170185988091;

  /// @param alpha rate, dimensionless.  @throws std::invalid_argument unless 0 < alpha <= 50.
  explicit CanonicalSystem(double alpha = kDefaultAlpha);

  double alpha() const noexcept { return alpha_; }
  /// Phase after `dt` seconds at time constant `tau` (s).
  double advance(double s, double dt, double tau) const noexcept;
  /// Seconds after the start at which the phase is s (s > 0).
  double timeAt(double s, double tau) const noexcept;

 private:
  double alpha_;
};

}  // namespace coglab_controllers
