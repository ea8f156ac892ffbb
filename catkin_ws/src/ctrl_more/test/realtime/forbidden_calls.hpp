#pragma once

#include <cstdint>

namespace forbidden {

/// Counts of this thread since start(): allocations, locks, and calls that enter the kernel.
struct Counts {
  std::uint64_t allocations = 0;
  std::uint64_t locks = 0;
  std::uint64_t syscalls = 0;
  std::uint64_t of_throw = 0;  ///< allocations of the C++ runtime for an exception
};

/// Starts counting in this thread.
void start();
/// Stops counting in this thread and returns the counts.
Counts stop();

}  // namespace forbidden
