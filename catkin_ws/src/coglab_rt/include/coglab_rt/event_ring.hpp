/// @file
/// Wait-free queue from the control cycle to the publisher thread.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace coglab_rt {

/// Bounded queue with one writer and one reader thread, both wait-free, no allocation.
/// A full queue refuses the newest entry and counts it, so that the cycle never waits for the
/// publisher.
/// @tparam Size number of entries, a power of two
template <typename T, std::size_t Size>
class EventRing {
  static_assert((Size & (Size - 1)) == 0, "Size must be a power of two");

 public:
  /// Writer: appends an entry. Returns false and counts it if the queue is full.
  bool push(const T& value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) == Size) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    entries_[head & (Size - 1)] = value;
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// Reader: takes the oldest entry. Returns false if there is none.
  bool pop(T& value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail == head_.load(std::memory_order_acquire)) return false;
    value = entries_[tail & (Size - 1)];
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Number of refused entries.
  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::array<T, Size> entries_{};
  std::atomic<std::size_t> head_{0};
  std::atomic<std::size_t> tail_{0};
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace coglab_rt
