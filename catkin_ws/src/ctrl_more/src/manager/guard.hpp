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

/// Corrections of one signal, as doubles of the signal's size. Vector: the sum. Pose: the position
/// sum and the left quaternion factor. Quaternion: the left factor.
namespace ctrl_more::correction {

/// Norm of a correction's sum (for poses: of the position), and its rotation angle [rad].
struct Norms {
  double size = 0.0;
  double angle = 0.0;
};

using Quaternion = Eigen::Map<Eigen::Quaterniond>;
using ConstQuaternion = Eigen::Map<const Eigen::Quaterniond>;

/// Number of doubles before the quaternion; all doubles for a vector.
inline int linearPart(SignalKind kind, int size) {
  return kind == SignalKind::Vector ? size : size - 4;
}

/// True if a correction has no effect.
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

/// Correction from `before` to `after`; exactly the identity for equal bits.
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

/// Sets `out` to `before` with a correction applied. `out` may be `before`.
inline void apply(SignalKind kind, int size, const double* before, const double* c, double* out) {
  if (isIdentity(kind, size, c)) {
    // Without a correction every bit stays: signs of zeros, and quaternions that are nearly unit.
    if (out != before) std::copy(before, before + size, out);
    return;
  }
  const int n = linearPart(kind, size);
  for (int i = 0; i < n; ++i) out[i] = before[i] + c[i];
  if (kind == SignalKind::Vector) return;
  const Eigen::Quaterniond q = ConstQuaternion(c + n) * ConstQuaternion(before + n);
  Quaternion(out + n) = q.normalized();
}

/// Interpolates two corrections along the shorter way, `share` in [0, 1]. `out` may alias either.
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
    // Most corrections have no rotation.
    if (sine != 0.0) result.angle = 2.0 * std::atan2(sine, std::abs(q[3]));
  }
  return result;
}

/// Zero for a finite number, otherwise not zero. Without a branch.
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

/// Tolerance of a quaternion's squared norm, for 1e-6 of the norm.
constexpr double kUnitTolerance = 2e-6;

/// Squared norm of a quaternion minus one.
inline double squareOff(const double* q) {
  return (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]) - 1.0;
}

/// True if the signal has no quaternion or its quaternion is unit within 1e-6.
inline bool isUnit(SignalKind kind, int size, const double* values) {
  return kind == SignalKind::Vector || std::abs(squareOff(values + size - 4)) <= kUnitTolerance;
}

}  // namespace ctrl_more::correction

namespace ctrl_more {

/// One signal that a controller modifies, for use in the cycle.
struct WrittenSignal {
  ControlSignal signal;
  int offset;  ///< offset in the control buffer
  int local;   ///< offset in buffers of the controller's numbers
  int size;
  SignalKind kind;
  CorrectionLimit limit;
  StopPolicy on_pause;
  bool limited;  ///< has a finite limit
  bool rated;    ///< has a finite rate limit
};

/// Checks the references that a controller wrote, and can restore them.
///
/// The cycle calls note(), judge() and the restore functions: no allocation, no exception.
class Guard {
 public:
  /// @param uses the resolved signals of the controller
  /// @param store the control states
  void configure(const std::vector<ResolvedControlUse>& uses, const ControlStates& store);

  /// The signals that the controller modifies.
  const std::vector<WrittenSignal>& written() const { return written_; }
  /// Doubles that the controller modifies.
  int total() const { return total_; }

  /// Stores the references before the controller runs.
  /// @param data the control buffer
  void note(const double* data) noexcept;
  /// The stored references; offsets as in WrittenSignal::local.
  const double* found() const { return found_.data(); }
  /// Checks the references after the controller ran; None if they are valid.
  /// @param data the control buffer
  /// @param dt time since the last cycle [s]
  FaultKind judge(const double* data, double dt) noexcept;
  /// Restores the stored references.
  void restore(double* data) const noexcept;
  /// Test mode: restores numbers that the controller changed without declaring them.
  /// @param data the control buffer
  /// @param before copy of the control buffer before the controller
  /// @param size number of doubles in it
  /// @return true if it restored any number
  bool restoreUndeclared(double* data, const double* before, int size) const noexcept;
  /// The rate of the next correction is not checked, because it follows no other.
  void forgetRate() { last_valid_ = false; }

 private:
  FaultKind judgeLimits(const WrittenSignal& w, const double* data, double dt) noexcept;

  std::vector<WrittenSignal> written_;
  std::vector<bool> declared_;  // doubles of the control buffer that it may change
  int total_ = 0;
  bool last_valid_ = false;
  std::vector<double> found_;
  std::vector<double> last_;  // correction of the last run, before blending
  std::vector<double> now_;   // buffer for one correction
  std::vector<double> step_;  // buffer for another one
};

}  // namespace ctrl_more
