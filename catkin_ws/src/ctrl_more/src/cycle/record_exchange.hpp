#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

namespace ctrl_more {

/// Which of two buffers the control cycle writes its records into, and which a reader may read.
/// One word decides, so that the cycle never waits: the buffers change places only between two
/// cycles, and only when a reader asks. Everything in the buffers is plain memory.
class RecordExchange {
 public:
  /// The cycle: from now until end() the buffer is the cycle's alone.
  /// @return its index
  unsigned begin() { return word_.fetch_or(kBusy, std::memory_order_acquire) & kIndex; }

  /// The cycle: the buffer is complete. If a reader asked, the next cycle gets the other one.
  /// @param wrote false: no record was written since begin()
  void end(bool wrote) {
    std::uint32_t seen = word_.load(std::memory_order_relaxed), next = 0;
    do {
      next = (seen & (kIndex | kFresh)) | (wrote ? kFresh : 0u);
      if ((seen & kWanted) && (next & kFresh)) next = (next ^ kIndex) & ~kFresh;
    } while (!word_.compare_exchange_weak(seen, next, std::memory_order_acq_rel,
                                          std::memory_order_relaxed));
  }

  /// A reader (one at a time): makes the newest complete buffer its own until the next call.
  /// @param timeout_s longest wait for a cycle to end [s]
  /// @return its index; the one from before if there is nothing newer
  unsigned acquire(double timeout_s = 0.05) {
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
    std::uint32_t seen = word_.load(std::memory_order_acquire);
    const std::uint32_t changed = (seen & kIndex) ^ kIndex;
    while ((seen & kIndex) != changed) {
      if ((seen & kBusy) == 0) {
        if ((seen & kFresh) == 0) break;
        // No cycle is running: change places for it.
        if (word_.compare_exchange_weak(seen, changed, std::memory_order_acq_rel)) break;
        continue;
      }
      // Gives back what was read before.
      word_.fetch_or(kWanted, std::memory_order_release);
      if (std::chrono::steady_clock::now() > deadline) break;
      std::this_thread::sleep_for(std::chrono::microseconds(20));
      seen = word_.load(std::memory_order_acquire);
    }
    // From here on nothing changes places any more.
    const std::uint32_t last = word_.fetch_and(~kWanted, std::memory_order_acq_rel);
    return (last & kIndex) ^ kIndex;
  }

 private:
  static constexpr std::uint32_t kIndex = 1;   // of the cycle's buffer
  static constexpr std::uint32_t kBusy = 2;    // between begin() and end()
  static constexpr std::uint32_t kWanted = 4;  // a reader asks for the next one
  static constexpr std::uint32_t kFresh = 8;   // the cycle's buffer is newer than the reader's

  std::atomic<std::uint32_t> word_{0};
};

}  // namespace ctrl_more
