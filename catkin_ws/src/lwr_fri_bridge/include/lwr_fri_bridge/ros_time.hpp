/// @file
/// Between the stamps of ROS messages and the steady clock, for any stamp that a wire can carry.
///
/// The difference of two ros::Time throws when it does not fit into 32 bits of seconds; here it is
/// taken in 64 bits of nanoseconds, which hold every one.
#pragma once

#include <cstdint>

#include <ros/time.h>

#include "lwr_fri_bridge/fri_thread.hpp"

namespace lwr_fri_bridge {

/// Age of a stamp now, ns; negative: it lies in the future. Never throws.
inline std::int64_t ageOf(const ros::Time& stamp) {
  return static_cast<std::int64_t>(ros::Time::now().toNSec()) -
         static_cast<std::int64_t>(stamp.toNSec());
}

/// A stamp on the steady clock, ns, through both clocks' present readings.
inline std::int64_t steadyTime(const ros::Time& stamp) { return steadyNow() - ageOf(stamp); }

/// A time of the steady clock (ns, not later than now) as a stamp.
inline ros::Time rosTime(std::int64_t steady_ns) {
  const std::int64_t now = static_cast<std::int64_t>(ros::Time::now().toNSec());
  const std::int64_t stamp = now - (steadyNow() - steady_ns);
  ros::Time time;
  return time.fromNSec(static_cast<std::uint64_t>(stamp > 0 ? stamp : now));
}

}  // namespace lwr_fri_bridge
