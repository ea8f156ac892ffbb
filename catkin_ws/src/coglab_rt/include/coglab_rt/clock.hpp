/// @file
/// The common clock of samples, commands, plans and goals.
#pragma once

#include <chrono>
#include <cstdint>

namespace coglab_rt {

/// Steady clock, ns. Real-time safe: no system call if the C library reads it from the vDSO.
inline std::int64_t steadyNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Largest lead of a stamp from another process over this clock, ns. Both read the same clock, so
/// this allows for two readings, not for two clocks.
constexpr std::int64_t kFutureAllowance_ns = 50'000'000;

}  // namespace coglab_rt
