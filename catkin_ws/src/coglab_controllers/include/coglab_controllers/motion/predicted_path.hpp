/// @file
/// Predicted path of a motion, passed from the control cycle to the display.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// The path of the end-effector if nothing disturbs it.
struct PredictedPath {
  std::int64_t stamp_ns = 0;  ///< time zero of the times in `path`, on the clock of the samples
  std::string motion;         ///< name of the primitive, or id of the ptp motion
  TimedPath path;
};

/// Copies data out of the control cycle on request. One thread requests and reads; the control
/// thread makes the copy. Wait-free on both sides.
template <typename T>
class CopyOnRequest {
 public:
  void ask() noexcept { asked_.store(true, std::memory_order_release); }

  /// Control thread. @param make returns the copy; called only after a request
  template <typename Make>
  void give(Make&& make) {
    if (!asked_.load(std::memory_order_relaxed)) return;
    asked_.store(false, std::memory_order_relaxed);
    copies_.write(make());
  }

  /// Returns true if a copy arrived since the last call.
  bool read(T& copy) { return copies_.read(copy); }

 private:
  std::atomic<bool> asked_{false};
  TripleBuffer<T> copies_;
};

}  // namespace coglab_controllers
