/// @file
/// Minimum jerk as feedback: the motion of a hand to its end, from any position, velocity and
/// acceleration.
///
/// Flash and Hogan (1985); as a linear system of the remaining distance and time: Hoff and Arbib
/// (1993). A change of the end changes the motion without a step, as when people correct a reach.
#pragma once

#include <Eigen/Core>

namespace coglab_perception {

/// Position, velocity and acceleration (m, m/s, m/s^2) after a step, from position, velocity,
/// acceleration and end (m).
using Transition = Eigen::Matrix<double, 3, 4>;

/// True if a motion ends within a step. Both in s.
inline bool endsWithin(double remaining, double step) { return step >= remaining - 1e-9; }

/// The motion over `step` s, `remaining` s before its end. The end does not change. A motion that
/// ends within the step rests at its end. A step <= 0 changes nothing.
Transition transition(double remaining, double step);

}  // namespace coglab_perception
