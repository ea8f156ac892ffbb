#pragma once

#include <time.h>

#include <cstdint>

namespace ctrl_more {

/// Steady clock [ns]. clock_gettime needs no system call on Linux: the kernel maps the clock into
/// the process.
inline std::int64_t steadyNow() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1000000000 + now.tv_nsec;
}

}  // namespace ctrl_more
