/// @file
/// How fast the simulated cell may run on a computer that is busy with other programs. No clock
/// here.
#pragma once

#include <string>

namespace coglab_sim {

/// What was measured over the last second. Shares are 0..1.
struct ComputerLoad {
  double late_steps = 0.0;    ///< of the cell's periods, begun later than a fifth of a period
  double latest = 0.0;        ///< s, of the latest of them
  double lost_answers = 0.0;  ///< of measurements sent in time, without an answer within a period
  double missing = 0.0;       ///< of the person's hand messages: nodes that were not scheduled

  bool tooBusy() const;
};

/// Halves the simulated time per real time while the computer is too busy, down to a quarter, and
/// raises it again, more and more carefully where that was too early.
class Pace {
 public:
  /// @param wanted  simulated over real time where nothing hinders; faster than 1 is never slowed
  explicit Pace(double wanted);
  /// Takes the measurement of one more second. Returns the factor from now on.
  double update(const ComputerLoad& load);
  double factor() const { return factor_; }
  /// The computer is too busy now, or was lately so that the cell is slowed.
  bool busy() const { return factor_ < wanted_ || busy_ >= kBusySeconds; }

  static constexpr int kBusySeconds = 2;  ///< in a row, until the factor is halved

 private:
  double wanted_, factor_;
  int busy_ = 0, good_ = 0;     // s in a row
  int patience_ = 4;            // s of good ones until it is raised
  int since_raised_ = 1 << 20;  // s
};

/// One sentence for people: what was measured, the limits, what happens.
std::string describe(const ComputerLoad& load, double factor, bool busy);

}  // namespace coglab_sim
