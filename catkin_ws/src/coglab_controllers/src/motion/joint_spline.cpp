#include "coglab_controllers/motion/joint_spline.hpp"

#include <algorithm>

namespace coglab_controllers {

JointPoint hermite(const JointPoint& from, const JointPoint& to, bool quintic,
                   double time) noexcept {
  const double span = to.time - from.time;
  const double u = (time - from.time) / span;
  const JointVector way = to.position - from.position;
  const JointVector v0 = span * from.velocity, v1 = span * to.velocity;
  JointVector c2, c3, c4 = JointVector::Zero(), c5 = JointVector::Zero();
  if (quintic) {
    const JointVector a0 = span * span * from.acceleration, a1 = span * span * to.acceleration;
    c2 = 0.5 * a0;
    c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
    c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
    c5 = 6.0 * way - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
  } else {
    c2 = 3.0 * way - 2.0 * v0 - v1;
    c3 = -2.0 * way + v0 + v1;
  }
  JointPoint point;
  point.time = time;
  point.position = from.position + u * (v0 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
  point.velocity = (v0 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / span;
  point.acceleration =
      (2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (span * span);
  return point;
}

void JointSpline::estimateVelocities(std::vector<JointPoint>& points) {
  for (std::size_t k = 1; k + 1 < points.size(); ++k) {
    const JointPoint &before = points[k - 1], &after = points[k + 1];
    const double h0 = points[k].time - before.time, h1 = after.time - points[k].time;
    for (int i = 0; i < kMaxJoints; ++i) {
      const double s0 = (points[k].position[i] - before.position[i]) / h0;
      const double s1 = (after.position[i] - points[k].position[i]) / h1;
      const double w0 = 2.0 * h1 + h0, w1 = h1 + 2.0 * h0;
      points[k].velocity[i] = s0 * s1 > 0.0 ? (w0 + w1) / (w0 / s0 + w1 / s1) : 0.0;
    }
  }
}

JointPoint JointSpline::at(double time) const noexcept {
  const auto rests = [time](JointPoint point) {
    point.time = time;
    point.velocity.setZero();
    point.acceleration.setZero();
    return point;
  };
  if (points_.empty()) return {};
  if (time >= points_.back().time) return rests(points_.back());
  if (time < points_.front().time) return rests(points_.front());
  const auto after =
      std::upper_bound(points_.begin(), points_.end(), time,
                       [](double t, const JointPoint& point) { return t < point.time; });
  return hermite(*(after - 1), *after, quintic_, time);
}

}  // namespace coglab_controllers
