#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctrl_more/description/setup.hpp"
#include "ctrl_more/manager/controller_status.hpp"
#include "ctrl_more/states/control_states.hpp"
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

namespace ctrl_more {

/// One signal that a controller modifies, as the cycle sees it.
struct WrittenSignal {
  ControlSignal signal;
  int offset;  ///< in the control buffer
  int local;   ///< in buffers of the controller's own numbers
  int size;
  SignalKind kind;
  CorrectionLimit limit;
  StopPolicy on_pause;
  bool limited;  ///< any finite limit
  bool rated;    ///< a finite rate limit
};

/// Judges what a controller left in the references, and undoes it.
///
/// note(), judge() and the restore functions are for the cycle: no allocation, no exception.
class Guard {
 public:
  /// @param uses the resolved signals of the controller
  /// @param store the control states
  void configure(const std::vector<ResolvedControlUse>& uses, const ControlStates& store);

  /// The signals that the controller modifies.
  const std::vector<WrittenSignal>& written() const { return written_; }
  /// Doubles that the controller modifies.
  int total() const { return total_; }

  /// Keeps what the controller is about to find.
  /// @param data the control buffer
  void note(const double* data) noexcept;
  /// What it found; places as in WrittenSignal::local.
  const double* found() const { return found_.data(); }
  /// What is wrong with what it left, if anything.
  /// @param data the control buffer
  /// @param dt time since the last cycle [s]
  FaultKind judge(const double* data, double dt) noexcept;
  /// Puts back what it found.
  void restore(double* data) const noexcept;
  /// Test mode: puts back what it did not declare and changed all the same.
  /// @param data the control buffer
  /// @param before all of it as it was
  /// @param size doubles in it
  /// @return true if there was anything
  bool restoreUndeclared(double* data, const double* before, int size) const noexcept;
  /// The next correction follows no other: its rate is not judged.
  void forgetRate() { last_valid_ = false; }

 private:
  FaultKind judgeLimits(const WrittenSignal& w, const double* data, double dt) noexcept;

  std::vector<WrittenSignal> written_;
  std::vector<bool> declared_;  // doubles of the control buffer it may change
  int total_ = 0;
  bool last_valid_ = false;
  std::vector<double> found_;
  std::vector<double> last_;  // correction of the last run, before blending
  std::vector<double> now_;   // room for one correction
  std::vector<double> step_;  // room for another
};

}  // namespace ctrl_more
