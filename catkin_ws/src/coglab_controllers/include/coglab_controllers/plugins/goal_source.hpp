/// @file
/// Where a motion controller gets poses of frames from: tf2, or whoever stands in for it.
#pragma once

#include <string>

#include "coglab_controllers/plugins/goal_gate.hpp"

namespace coglab_controllers {

/// Poses of frames, asked for outside the control cycle.
class GoalSource {
 public:
  virtual ~GoalSource() = default;

  /// Newest pose of `frame` in `reference`, with its time of capture in the clock of the samples; a
  /// transform that never changes counts as captured now.
  /// @param why set on failure: which frame is missing, or what is wrong with the transform
  virtual bool lookup(const std::string& reference, const std::string& frame,
                      GoalObservation& observation, std::string& why) = 0;
};

}  // namespace coglab_controllers
