/// @file
/// Joint positions over time through given points.
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

/// Returns the state at a time between two points. The polynomial matches their positions and
/// velocities (cubic), and also their accelerations (quintic). Real-time safe.
JointPoint hermite(const JointPoint& from, const JointPoint& to, bool quintic,
                   double time) noexcept;

/// A piecewise polynomial through points. Only the constructor and estimateVelocities() allocate.
class JointSpline {
 public:
  JointSpline() = default;
  /// @param points at least one, with increasing times
  /// @param quintic true: also match the accelerations of the points
  JointSpline(std::vector<JointPoint> points, bool quintic)
      : points_(std::move(points)), quintic_(quintic) {}

  /// Sets the velocities of the inner points so that no joint reverses or overshoots between two
  /// points: zero if a joint reverses at the point, else the weighted harmonic mean of both slopes
  /// (Fritsch and Butland, 1984). The first and the last velocity stay unchanged.
  static void estimateVelocities(std::vector<JointPoint>& points);

  double duration() const noexcept { return points_.empty() ? 0.0 : points_.back().time; }
  /// Returns the state at a time, s. Before the first and after the last point it is at rest there.
  /// Real-time safe.
  JointPoint at(double time) const noexcept;

 private:
  std::vector<JointPoint> points_;
  bool quintic_ = false;
};

}  // namespace coglab_controllers
