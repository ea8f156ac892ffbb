/// @file
/// Between the stamps of ROS messages and the steady clock, for any stamp that a wire can carry.
///
/// The difference of two ros::Time throws when it does not fit into 32 bits of seconds; here it is
/// taken in 64 bits of nanoseconds, which hold every one.
#pragma once

#include <cstdint>

#include <ros/time.h>

#include "coglab_rt/clock.hpp"

namespace coglab_rt {

/// A ROS time in ns, whatever its fields hold.
inline std::int64_t nanoseconds(const ros::Time& time) {
  return static_cast<std::int64_t>(time.sec) * 1'000'000'000 + static_cast<std::int64_t>(time.nsec);
}

/// Age of a stamp now, ns; negative: it lies in the future.
inline std::int64_t ageOf(const ros::Time& stamp) {
  return nanoseconds(ros::Time::now()) - nanoseconds(stamp);
}

/// A ROS time on the steady clock; zero stays zero. Two readings of the clocks differ by their
/// jitter: map a stamp once, and never tell two stamps apart by what they map to.
inline std::int64_t toSteady(const ros::Time& time, std::int64_t steady_now = steadyNow()) {
  return time.isZero() ? 0 : steady_now - ageOf(time);
}

/// A time of the steady clock (ns) as ROS time, through both clocks' present readings; what lies
/// before the beginning of ROS time becomes the present, because a stamp of zero means none.
inline ros::Time toRos(std::int64_t steady_ns) {
  const std::int64_t now = nanoseconds(ros::Time::now());
  const std::int64_t stamp = now - (steadyNow() - steady_ns);
  ros::Time time;
  return time.fromNSec(static_cast<std::uint64_t>(stamp > 0 ? stamp : now));
}

}  // namespace coglab_rt
