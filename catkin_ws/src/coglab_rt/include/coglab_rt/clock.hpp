/// @file
/// The one clock of samples, commands, plans and goals.
#pragma once

#include <chrono>
#include <cstdint>

namespace coglab_rt {

/// Steady clock, ns. Real-time safe (no system call where the C library reads it from the vDSO).
inline std::int64_t steadyNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// How far ahead of the clock a stamp from another process may lie, ns: two readings of one clock,
/// not two clocks.
constexpr std::int64_t kFutureAllowance_ns = 50'000'000;

}  // namespace coglab_rt
