#include "coglab_controllers/dmp/orientation_curve.hpp"

#include <algorithm>
#include <cmath>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {

void OrientationCurve::start(const Quaternion& start, const Vector3& angular_velocity,
                             const Quaternion& target, double duration) noexcept {
  start_ = start.normalized();
  // Two equal first segments give the given rotational velocity and zero acceleration at the start.
  lead_ = start_.conjugate() * angular_velocity * (duration / 5.0);
  turn_.setZero();
  setTarget(target);
}

void OrientationCurve::setTarget(const Quaternion& target) noexcept {
  const Quaternion after_lead = start_ * expRotation(2.0 * lead_);
  Vector3 turn = logRotation((after_lead.conjugate() * target.normalized()).normalized());
  // Beyond half a turn the logarithm changes to the opposite direction. Keep the branch nearest to
  // the present one.
  const double angle = turn.norm();
  if (angle > 1e-9 && turn_.squaredNorm() > 0.0) {
    const Vector3 other = turn * (1.0 - 2.0 * M_PI / angle);
    if ((other - turn_).squaredNorm() < (turn - turn_).squaredNorm()) turn = other;
  }
  turn_ = turn;
}

Quaternion OrientationCurve::at(double progress) const noexcept {
  const double u = std::clamp(progress, 0.0, 1.0), r = 1.0 - u;
  const double r2 = r * r, r3 = r2 * r, u2 = u * u;
  // Cumulative Bernstein sums of degree five: progress along each control segment.
  const double first = 1.0 - r3 * r2;
  const double second = first - 5.0 * u * r2 * r2;
  const double third = second - 10.0 * u2 * r3;
  return start_ * expRotation((first + second) * lead_) * expRotation(third * turn_);
}

}  // namespace coglab_controllers
