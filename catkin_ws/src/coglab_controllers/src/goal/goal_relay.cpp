#include "coglab_controllers/goal/goal_relay.hpp"

namespace coglab_controllers {

namespace {
constexpr std::int64_t kStaticPeriod_ns = 1'000'000'000;
}

bool GoalRelay::see(std::int64_t now_ns, const GoalObservation& seen) noexcept {
  if (gate_.update(now_ns, seen) != GoalGate::State::Fresh) return false;
  const GoalObservation& goal = gate_.goal();
  const bool same =
      told_ && goal.frame_ns == told_goal_.frame_ns && goal.clock_steps == told_goal_.clock_steps;
  // A static frame has no stamp: it is told again and again, as captured now.
  if (same && (goal.frame_ns != 0 || now_ns - told_ns_ < kStaticPeriod_ns)) return false;
  told_ = true;
  told_ns_ = now_ns;
  told_goal_ = goal;
  return true;
}

}  // namespace coglab_controllers
