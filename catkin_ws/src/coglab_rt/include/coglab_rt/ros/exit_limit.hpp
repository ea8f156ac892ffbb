/// @file
/// Ends a process that unregisters from the ROS master even if the master does not answer.
#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace coglab_rt {

/// Ends the process with status 0 after this time, unless it ended before. Call it when the arm
/// stands and all threads that the arm needs are stopped. Only the process's registration at the
/// ROS master is left then, and roscpp waits for the master's answer without a limit.
inline void endProcessWithin(std::chrono::milliseconds limit) {
  std::thread([limit] {
    std::this_thread::sleep_for(limit);
    std::fprintf(stderr, "the ROS master does not answer: ended without unregistering\n");
    std::_Exit(0);
  }).detach();
}

}  // namespace coglab_rt
