/// @file
/// The newest value from one thread to another.
#pragma once

#include <atomic>
#include <cstdint>

namespace coglab_rt {

/// A value that one thread writes and one thread reads, both wait-free: three slots, the newest
/// complete one wins.
template <typename T>
class TripleBuffer {
 public:
  /// Publishes a value (writer thread only).
  void write(const T& value) {
    slots_[write_] = value;
    write_ =
        middle_.exchange(static_cast<std::uint8_t>(write_ | kFresh), std::memory_order_acq_rel) &
        kIndex;
  }

  /// Copies the newest value (reader thread only). Returns whether it is newer than the last one
  /// read.
  bool read(T& value) {
    const bool fresh = (middle_.load(std::memory_order_relaxed) & kFresh) != 0;
    if (fresh) read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    value = slots_[read_];
    return fresh;
  }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  T slots_[3];
  std::uint8_t write_ = 0, read_ = 1;
  std::atomic<std::uint8_t> middle_{2};
};

}  // namespace coglab_rt
