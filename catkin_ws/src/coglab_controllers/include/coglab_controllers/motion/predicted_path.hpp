/// @file
/// The path that a motion is going to take, from the control cycle to whoever shows it.
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
  std::string motion;         ///< what moves the arm: a primitive, or the id of a ptp motion
  TimedPath path;
};

/// A copy of what the control cycle works on, made in the cycle when somebody outside has asked for
/// it: one thread asks and reads, the control thread gives. Wait-free on both sides.
template <typename T>
class CopyOnRequest {
 public:
  void ask() noexcept { asked_.store(true, std::memory_order_release); }

  /// Control thread. @param make gives the copy; called only if one was asked for
  template <typename Make>
  void give(Make&& make) {
    if (!asked_.load(std::memory_order_relaxed)) return;
    asked_.store(false, std::memory_order_relaxed);
    copies_.write(make());
  }

  /// Whether a copy has come since the last call.
  bool read(T& copy) { return copies_.read(copy); }

 private:
  std::atomic<bool> asked_{false};
  TripleBuffer<T> copies_;
};

}  // namespace coglab_controllers
