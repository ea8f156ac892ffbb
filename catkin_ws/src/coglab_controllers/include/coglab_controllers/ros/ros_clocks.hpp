/// @file
/// Between ROS time and the steady clock. In 64 bits: a stamp may be any number, and the
/// differences of ros::Time throw.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include <ros/time.h>

namespace coglab_controllers {

/// Steady clock, ns: the clock of samples, plans and goals.
inline std::int64_t steadyNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// A ROS time in ns, whatever its fields hold.
inline std::int64_t nanoseconds(const ros::Time& time) {
  return static_cast<std::int64_t>(time.sec) * 1'000'000'000 + static_cast<std::int64_t>(time.nsec);
}

/// A time of the steady clock as ROS time, through both clocks' present readings.
inline ros::Time toRos(std::int64_t steady_ns) {
  const std::int64_t stamp = nanoseconds(ros::Time::now()) - (steadyNow() - steady_ns);
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(0, stamp)));
  return time;
}

/// A ROS time on the steady clock; zero stays zero. Two readings of the clocks differ by their
/// jitter: map a stamp once, and never tell two stamps apart by what they map to.
inline std::int64_t toSteady(const ros::Time& time, std::int64_t steady_now = steadyNow()) {
  if (time.isZero()) return 0;
  return steady_now - (nanoseconds(ros::Time::now()) - nanoseconds(time));
}

}  // namespace coglab_controllers
