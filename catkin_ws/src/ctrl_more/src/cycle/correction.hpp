#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctrl_more/states/signal.hpp"
#include "ctrl_more/states/so3.hpp"

/// Corrections of one signal, as plain doubles of the signal's size: a vector holds the sum, a
/// pose holds position sum and left quaternion factor, a quaternion holds the left factor.
namespace ctrl_more::correction {

/// Norm of a correction: of the sum (of the position for poses), and angle of its rotation [rad].
struct Norms {
  double size = 0.0;
  double angle = 0.0;
};

using Quaternion = Eigen::Map<Eigen::Quaterniond>;
using ConstQuaternion = Eigen::Map<const Eigen::Quaterniond>;

/// Doubles before the quaternion; all of them for a vector.
inline int linearPart(SignalKind kind, int size) {
  return kind == SignalKind::Vector ? size : size - 4;
}

/// True if a correction changes nothing.
inline bool isIdentity(SignalKind kind, int size, const double* c) {
  const int n = kind == SignalKind::Vector ? size : size - 1;
  for (int i = 0; i < n; ++i) {
    if (c[i] != 0.0) return false;
  }
  return kind == SignalKind::Vector || c[size - 1] == 1.0;
}

/// No correction.
inline void setIdentity(SignalKind kind, int size, double* c) {
  std::fill(c, c + size, 0.0);
  if (kind != SignalKind::Vector) c[size - 1] = 1.0;
}

/// The correction that leads from `before` to `after`; exactly none for equal bits.
inline void difference(SignalKind kind, int size, const double* before, const double* after,
                       double* c) {
  const int n = linearPart(kind, size);
  for (int i = 0; i < n; ++i) c[i] = after[i] - before[i];
  if (kind != SignalKind::Vector && std::memcmp(before + n, after + n, 4 * sizeof(double)) == 0) {
    setIdentity(kind, 4, c + n);
    return;
  }
  if (kind == SignalKind::Vector) return;
  Quaternion(c + n) =
      (ConstQuaternion(after + n) * ConstQuaternion(before + n).conjugate()).normalized();
}

/// `out` = `before` with a correction applied; `out` may be `before`.
inline void apply(SignalKind kind, int size, const double* before, const double* c, double* out) {
  if (isIdentity(kind, size, c)) {
    // No correction keeps every bit: signs of zeros, and quaternions that are unit only nearly.
    if (out != before) std::copy(before, before + size, out);
    return;
  }
  const int n = linearPart(kind, size);
  for (int i = 0; i < n; ++i) out[i] = before[i] + c[i];
  if (kind == SignalKind::Vector) return;
  const Eigen::Quaterniond q = ConstQuaternion(c + n) * ConstQuaternion(before + n);
  Quaternion(out + n) = q.normalized();
}

/// `out` between two corrections, `share` in [0, 1] on the shorter way; may alias either.
inline void between(SignalKind kind, int size, const double* from, const double* to, double share,
                    double* out) {
  const int n = linearPart(kind, size);
  for (int i = 0; i < n; ++i) out[i] = from[i] + share * (to[i] - from[i]);
  if (kind == SignalKind::Vector) return;
  const Eigen::Quaterniond q =
      ctrl_more::between(ConstQuaternion(from + n), ConstQuaternion(to + n), share);
  Quaternion(out + n) = q.normalized();
}

/// Norms of a correction.
inline Norms norms(SignalKind kind, int size, const double* c) {
  const int n = linearPart(kind, size);
  Norms result;
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += c[i] * c[i];
  result.size = std::sqrt(sum);
  if (kind != SignalKind::Vector) {
    const double* q = c + n;
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    // Most corrections do not turn anything.
    if (sine != 0.0) result.angle = 2.0 * std::atan2(sine, std::abs(q[3]));
  }
  return result;
}

/// Zero for a finite number, other bits otherwise; without a branch.
inline std::uint64_t notFinite(double value) {
  const double zero = value - value;  // +0 for every finite number, NaN for others
  std::uint64_t bits = 0;
  std::memcpy(&bits, &zero, sizeof bits);
  return bits;
}

/// True if every number is finite.
inline bool isFinite(int size, const double* values) {
  std::uint64_t collected = 0;
  for (int i = 0; i < size; ++i) collected |= notFinite(values[i]);
  return collected == 0;
}

/// How far the square of a quaternion's norm may be from one: 1e-6 of the norm.
constexpr double kUnitTolerance = 2e-6;

/// Square of a quaternion's norm, less one.
inline double squareOff(const double* q) {
  return (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]) - 1.0;
}

/// True if the quaternion in the signal, if it has one, is unit within 1e-6.
inline bool isUnit(SignalKind kind, int size, const double* values) {
  return kind == SignalKind::Vector || std::abs(squareOff(values + size - 4)) <= kUnitTolerance;
}

}  // namespace ctrl_more::correction
