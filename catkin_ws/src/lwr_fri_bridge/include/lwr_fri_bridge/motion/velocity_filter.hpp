/// @file
/// Velocity filter (D4.10 Figure 1): joint velocities from joint positions.
///
/// It takes the difference quotient over the cycles that really passed, then a first-order low-pass
/// with time constant T. With k = 1 - exp(-dt/T), a ramp is delayed by dt/2 + dt (1-k)/k. White
/// noise of the positions causes a standard deviation of the velocity of (k/dt) sqrt(2/(2-k)) times
/// its own. A gap of n cycles counts as n samples on the straight line between its ends, so lost
/// packets cause no spike and keep the time constant.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

/// Real-time safe.
class VelocityFilter {
 public:
  /// `time_constant` in s, >= 0; 0: plain difference quotient.
  explicit VelocityFilter(double time_constant) : time_constant_(time_constant) {}

  /// Clears the filter. The next sample gives velocity 0.
  void reset() { primed_ = false; }

  /// Adds a position (rad), measured `cycles` (>= 1) FRI cycles of `dt` seconds after the previous
  /// one. Returns the velocity (rad/s).
  const Vector7& update(const Vector7& position, std::uint32_t cycles, double dt);

  const Vector7& velocity() const { return velocity_; }

 private:
  double time_constant_;
  bool primed_ = false;
  Vector7 last_ = Vector7::Zero(), velocity_ = Vector7::Zero();
};

}  // namespace lwr_fri_bridge
