/// @file
/// A bounded wait-free queue from one thread to another.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace lwr_fri_bridge {

/// Holds up to N - 1 values. One thread pushes, one pops; neither waits nor allocates.
template <typename T, std::size_t N>
class SpscQueue {
 public:
  /// Returns false (and drops the value) when the queue is full.
  bool push(const T& value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t next = (tail + 1) % N;
    if (next == head_.load(std::memory_order_acquire)) return false;
    slots_[tail] = value;
    tail_.store(next, std::memory_order_release);
    return true;
  }

  /// Returns false when the queue is empty.
  bool pop(T& value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    value = slots_[head];
    head_.store((head + 1) % N, std::memory_order_release);
    return true;
  }

 private:
  std::array<T, N> slots_{};
  std::atomic<std::size_t> head_{0}, tail_{0};
};

}  // namespace lwr_fri_bridge
