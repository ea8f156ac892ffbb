#include "coglab_controllers/kinematics/rotation.hpp"

#include <cmath>

namespace coglab_controllers {

Quaternion expRotation(const Vector3& r) noexcept {
  const double angle = r.norm();
  // sin(a/2)/a by its series near zero, where the quotient loses digits
  const double factor = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  return Quaternion(std::cos(0.5 * angle), factor * r.x(), factor * r.y(), factor * r.z());
}

Vector3 logRotation(const Quaternion& q) noexcept {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Vector3 v = sign * q.vec();
  const double sine = v.norm(), cosine = sign * q.w();
  const double factor = sine < 1e-4 ? 2.0 / cosine * (1.0 - sine * sine / (3.0 * cosine * cosine))
                                    : 2.0 * std::atan2(sine, cosine) / sine;
  return factor * v;
}

Vector3 rotationBetween(const Quaternion& from, const Quaternion& to) noexcept {
  return logRotation(to * from.conjugate());
}

// Quaternion::FromTwoVectors does the same by a singular value decomposition, which takes the
// compiler seconds in each file.
Quaternion shortestTurn(const Vector3& from, const Vector3& to) noexcept {
  const Vector3 a = from.stableNormalized(), b = to.stableNormalized();
  const Vector3 between = a + b;
  if (const double length = between.norm(); length > 1e-8) {
    const Vector3 half = between / length, axis = a.cross(half);
    return Quaternion(a.dot(half), axis.x(), axis.y(), axis.z()).normalized();
  }
  Vector3::Index least = 0;
  a.cwiseAbs().minCoeff(&least);
  const Vector3 axis = a.cross(Vector3::Unit(least)).normalized();
  return Quaternion(0.0, axis.x(), axis.y(), axis.z());
}

bool isUnit(const Quaternion& q) noexcept {
  return q.coeffs().allFinite() && std::abs(q.norm() - 1.0) <= 1e-3;
}

}  // namespace coglab_controllers
