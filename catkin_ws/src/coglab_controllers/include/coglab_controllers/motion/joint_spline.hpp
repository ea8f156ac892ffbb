/// @file
/// Joint positions over time, through given points.
#pragma once

#include <utility>
#include <vector>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// State of the joints at one time.
struct JointPoint {
  double time = 0.0;                               ///< s
  JointVector position = JointVector::Zero();      ///< rad
  JointVector velocity = JointVector::Zero();      ///< rad/s
  JointVector acceleration = JointVector::Zero();  ///< rad/s^2
};

/// The state between two points, at a time between theirs. The polynomial meets positions and
/// velocities (cubic), and the accelerations too (quintic). Real-time safe.
JointPoint hermite(const JointPoint& from, const JointPoint& to, bool quintic,
                   double time) noexcept;

/// A piecewise polynomial through points. Only the constructor and estimateVelocities() allocate.
class JointSpline {
 public:
  JointSpline() = default;
  /// @param points at least one, with growing times
  /// @param quintic true: the accelerations of the points are met too
  JointSpline(std::vector<JointPoint> points, bool quintic)
      : points_(std::move(points)), quintic_(quintic) {}

  /// Sets the velocities of the inner points so that no joint turns back or overshoots between two
  /// points: zero where a joint reverses, else the weighted harmonic mean of both slopes
  /// (Fritsch and Butland, 1984). First and last stay as they are.
  static void estimateVelocities(std::vector<JointPoint>& points);

  double duration() const noexcept { return points_.empty() ? 0.0 : points_.back().time; }
  /// The state at a time, s; before the first and after the last point it rests there. Real-time
  /// safe.
  JointPoint at(double time) const noexcept;

 private:
  std::vector<JointPoint> points_;
  bool quintic_ = false;
};

}  // namespace coglab_controllers
