/// @file
/// Where a motion is going to be, without the arm: for people who look at it before and during it.
#pragma once

#include <vector>

#include "coglab_controllers/dmp/cartesian_motion.hpp"

namespace coglab_controllers {

/// Poses of the end-effector in order of time, and when it is there.
struct TimedPath {
  std::vector<double> times;  ///< s from now, growing, one for each pose
  std::vector<Pose> poses;    ///< m and unit quaternions
};

/// The least speed of a clock that a prediction reckons with: one that stands has no end.
constexpr double kSlowestClock = 0.1;

/// The set-points of a motion from where it is to its end, by the code that drives it. Allocates:
/// not for the control cycle.
/// @param motion under way, in the frame of `goal`; one that is idle has no path
/// @param goal as received, taken to stay where it is
/// @param rate 0..1 of the motion's clock, taken to stay as well, kSlowestClock at least
/// @return at most kPathPoints + 1 poses, the first of them now; none if the motion is idle
TimedPath rollOut(CartesianMotion motion, const Pose& goal, double rate = 1.0);

constexpr int kPathPoints = 40;

}  // namespace coglab_controllers
