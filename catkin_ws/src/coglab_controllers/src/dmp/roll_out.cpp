#include "coglab_controllers/dmp/roll_out.hpp"

#include <algorithm>

namespace coglab_controllers {

namespace {

constexpr double kStep = 0.01;     // s of the motion's own time; longer in a long motion, so
constexpr double kSteps = 400.0;   // that a duration costs so many steps at most
constexpr double kThere = 1e-3;    // m from the goal at which a motion that has ended is drawn to
constexpr double kLongest = 3.0;   // durations after which a motion is left as it is
constexpr double kShortest = 2.0;  // s, the least time to come to rest

/// Every n-th entry, so that at most kPathPoints steps are left, and the last one.
TimedPath thinned(const TimedPath& path) {
  const std::size_t count = path.times.size();
  if (count <= kPathPoints + 1) return path;
  TimedPath kept;
  const std::size_t last = count - 1;
  for (std::size_t i = 0; i <= kPathPoints; ++i) {
    const std::size_t at = i * last / kPathPoints;
    kept.times.push_back(path.times[at]);
    kept.poses.push_back(path.poses[at]);
  }
  return kept;
}

}  // namespace

TimedPath rollOut(CartesianMotion motion, const Pose& goal, double rate, const Vector3& approach) {
  TimedPath path;
  if (motion.phase() == CartesianMotion::Phase::Idle) return path;
  const double clock = std::clamp(rate, kSlowestClock, 1.0);
  const double step = std::max(kStep, motion.dmp().tau() / kSteps);
  const double dt = step / clock;
  const double longest = kLongest * motion.dmp().tau() + kShortest;
  for (double own = 0.0; own < longest; own += step) {
    path.poses.push_back(
        motion.step(dt, goal, clock, approach).pose);  // the set-point before the step
    path.times.push_back(own / clock);
    const bool ended = motion.phase() == CartesianMotion::Phase::Ended;
    if (ended && (motion.dmp().state().position - motion.goal()).norm() < kThere) break;
  }
  return thinned(path);
}

}  // namespace coglab_controllers
