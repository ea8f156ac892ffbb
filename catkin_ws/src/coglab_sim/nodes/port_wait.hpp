/// @file
/// The wait for the port of a bridge that starts later than the cell.
#pragma once

#include <cstdint>

namespace coglab_sim {

constexpr double kReminder = 30.0;  // s between two warnings that the port is missing

/// Calls `port` until it returns one, and returns it; 0 after `limit` s, or if `pause` returns
/// false.
/// @param seconds  steady time since the start of the wait
/// @param remind  called every kReminder s
template <typename Port, typename Seconds, typename Remind, typename Pause>
std::uint16_t pollPort(double limit, Port port, Seconds seconds, Remind remind, Pause pause) {
  double next = kReminder;
  while (true) {
    if (const std::uint16_t found = port(); found != 0) return found;
    const double waited = seconds();
    if (waited >= limit || !pause()) return 0;
    if (waited < next) continue;
    remind(waited);
    next += kReminder;
  }
}

}  // namespace coglab_sim
