/// @file
/// Which sights of a frame the goal helper passes on as goals.
#pragma once

#include "coglab_controllers/goal/goal_gate.hpp"

namespace coglab_controllers {

/// The DMP plug-in takes a goal on dmp_goal as it is, so that the helper passes on only what a
/// motion would believe: nothing old, nothing far from the frames before it, and at first nothing
/// until frames agree. One frame counts once, however often it is looked up.
class GoalRelay {
 public:
  /// One look at the frame.
  /// @param now_ns clock of the samples  @param seen the newest sight, again and again
  /// @return whether goal() is to be published now. A static frame is told once a second.
  bool see(std::int64_t now_ns, const GoalObservation& seen) noexcept;

  const GoalObservation& goal() const noexcept { return gate_.goal(); }
  const GoalGate& gate() const noexcept { return gate_; }

 private:
  GoalGate gate_;
  bool told_ = false;
  std::int64_t told_ns_ = 0;  // when
  GoalObservation told_goal_;
};

}  // namespace coglab_controllers
