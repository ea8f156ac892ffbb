/// @file
/// Speed of the simulated cell on a busy computer. This code reads no clock.
#pragma once

#include <string>

namespace coglab_sim {

/// Load measured over the last second. Shares are 0..1.
struct ComputerLoad {
  double late_steps = 0.0;    ///< share of periods that began more than a fifth of a period late
  double latest = 0.0;        ///< s, largest delay of a period
  double lost_answers = 0.0;  ///< share of timely measurements without an answer in a period
  double missing = 0.0;       ///< share of missing hand messages; other nodes were not scheduled

  bool tooBusy() const;
};

/// Slows the simulation while the computer is too busy. It halves the factor (simulated over real
/// time), down to a quarter, and raises it again later. After each raise that came too early it
/// waits longer.
class Pace {
 public:
  /// @param wanted  factor on a computer that is not busy; above 1 it is never reduced
  explicit Pace(double wanted);
  /// Evaluates the load of one more second. Returns the new factor.
  double update(const ComputerLoad& load);
  double factor() const { return factor_; }
  /// True if the computer is too busy now, or the cell still runs slower than wanted.
  bool busy() const { return factor_ < wanted_ || busy_ >= kBusySeconds; }

  static constexpr int kBusySeconds = 2;  ///< too busy for so long (s): the factor is halved

 private:
  double wanted_, factor_;
  int busy_ = 0, good_ = 0;     // consecutive s
  int patience_ = 4;            // consecutive good s until the factor is raised
  int since_raised_ = 1 << 20;  // s
};

/// One sentence for the operator: measured values, limits and the consequence.
std::string describe(const ComputerLoad& load, double factor, bool busy);

}  // namespace coglab_sim
