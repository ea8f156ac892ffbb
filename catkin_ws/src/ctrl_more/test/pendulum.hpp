#pragma once

#include <cmath>
#include <vector>

namespace ctrl_more {

/// A robot as a linear inverted pendulum: its centre of mass follows the reference late, and what
/// is measured of the ZMP is moved by a push and by the robot's own motion.
struct Pendulum {
  double mass = 40.0, height = 0.8;
  double lag = 0.0;  // time constant with which the reference is followed [s]
  int delay = 1;     // cycles until the reference is taken
  std::vector<double> references = std::vector<double>(5, 0.0);
  double at = 0.0, before = 0.0;

  /// The ZMP of the next cycle.
  /// @param push horizontal force on the centre of mass [N]
  /// @param dt cycle [s]
  double zmp(double push, double dt) {
    const double wanted = references[references.size() - delay];
    const double next = lag > 0.0 ? at - std::expm1(-dt / lag) * (wanted - at) : wanted;
    const double acceleration = (next - 2.0 * at + before) / (dt * dt);
    before = at;
    at = next;
    return at - height / 9.80665 * acceleration + push * height / (mass * 9.80665);
  }
};

}  // namespace ctrl_more
