/// @file
/// Where a motion controller gets poses of frames from: tf2, or whoever stands in for it.
#pragma once

#include <cstdint>
#include <string>

#include "coglab_controllers/goal/goal_gate.hpp"

namespace coglab_controllers {

/// ns by which a stamp may be ahead of this computer's clock: what clocks that are synchronised
/// differ by. A frame that is further ahead is refused, because it would count as fresh for longer
/// than it is.
constexpr std::int64_t kClockTolerance_ns = 50'000'000;

/// Poses of frames, asked for outside the control cycle.
class GoalSource {
 public:
  virtual ~GoalSource() = default;

  /// Newest pose of `frame` in `reference`, with its own stamp and with its time of capture in the
  /// clock of the samples; a transform without a stamp counts as captured now.
  /// @param why set on failure: which frame is missing, or what is wrong with the transform
  virtual bool lookup(const std::string& reference, const std::string& frame,
                      GoalObservation& observation, std::string& why) = 0;

  /// How far the newest transform of `frame` was ahead of the clock, s, if it was refused for that;
  /// else 0.
  virtual double ahead(const std::string& /*frame*/) { return 0.0; }
};

}  // namespace coglab_controllers
