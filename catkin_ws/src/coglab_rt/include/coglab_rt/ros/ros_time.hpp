/// @file
/// Conversion between the stamps of ROS messages and the steady clock, for every possible stamp.
///
/// The difference of two ros::Time throws if its seconds do not fit into 32 bits. Here it is
/// computed in 64 bits of nanoseconds, which are always sufficient.
#pragma once

#include <cstdint>

#include <ros/time.h>

#include "coglab_rt/clock.hpp"

namespace coglab_rt {

/// A ROS time in ns, for any values of its fields.
inline std::int64_t nanoseconds(const ros::Time& time) {
  return static_cast<std::int64_t>(time.sec) * 1'000'000'000 + static_cast<std::int64_t>(time.nsec);
}

/// Current age of a stamp, ns; negative if it lies in the future.
inline std::int64_t ageOf(const ros::Time& stamp) {
  return nanoseconds(ros::Time::now()) - nanoseconds(stamp);
}

/// A ROS time on the steady clock, ns; zero stays zero. Two conversions differ by the jitter of the
/// clocks' readings: convert a stamp once, and do not distinguish stamps by their conversions.
inline std::int64_t toSteady(const ros::Time& time, std::int64_t steady_now = steadyNow()) {
  return time.isZero() ? 0 : steady_now - ageOf(time);
}

/// A time of the steady clock (ns) as ROS time, by the current readings of both clocks. A time
/// before the beginning of ROS time becomes the present, because a zero stamp means none.
inline ros::Time toRos(std::int64_t steady_ns) {
  const std::int64_t now = nanoseconds(ros::Time::now());
  const std::int64_t stamp = now - (steadyNow() - steady_ns);
  ros::Time time;
  return time.fromNSec(static_cast<std::uint64_t>(stamp > 0 ? stamp : now));
}

}  // namespace coglab_rt
