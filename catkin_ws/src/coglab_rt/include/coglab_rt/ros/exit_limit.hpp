/// @file
/// A process that says goodbye to the ROS master ends, whether the master answers or not.
#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace coglab_rt {

/// Ends the process with status 0 after this time, if nothing ended it before. Call it when the arm
/// stands and every thread that it needs is stopped: what is left is to unregister from the ROS
/// master, and roscpp waits for its answer without a limit.
inline void endProcessWithin(std::chrono::milliseconds limit) {
  std::thread([limit] {
    std::this_thread::sleep_for(limit);
    std::fprintf(stderr, "the ROS master does not answer: ended without unregistering\n");
    std::_Exit(0);
  }).detach();
}

}  // namespace coglab_rt
