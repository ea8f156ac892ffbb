#pragma once

#include <vector>

#include "ctrl_more/cycle/controller_status.hpp"
#include "ctrl_more/description/setup.hpp"
#include "ctrl_more/states/control_states.hpp"

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
