#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <vector>

namespace ctrl_more {

/// A block of doubles that the control cycle writes and any thread reads, without locks on either
/// side. The writer never waits; a reader that meets a write tries again.
class SharedSnapshot {
 public:
  /// @param size number of doubles
  explicit SharedSnapshot(std::size_t size) : words_(size) {}

  /// Starts a write (one writer only).
  void begin() {
    sequence_.store(sequence_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  /// Writes one number between begin() and end().
  void put(std::size_t index, double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    words_[index].store(bits, std::memory_order_release);
  }

  /// Ends a write.
  void end() {
    sequence_.store(sequence_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  /// Reads all numbers of one write.
  /// @param out resized to the block
  /// @param tries attempts before giving up
  /// @return false if a writer was in the way every time
  bool read(std::vector<double>& out, int tries = 1000) const {
    out.resize(words_.size());
    for (int attempt = 0; attempt < tries; ++attempt) {
      const std::uint64_t first = sequence_.load(std::memory_order_acquire);
      if (first % 2 != 0) continue;
      for (std::size_t i = 0; i < words_.size(); ++i) {
        const std::uint64_t bits = words_[i].load(std::memory_order_acquire);
        std::memcpy(&out[i], &bits, sizeof bits);
      }
      if (sequence_.load(std::memory_order_relaxed) == first) return true;
    }
    return false;
  }

 private:
  std::atomic<std::uint64_t> sequence_{0};
  std::vector<std::atomic<std::uint64_t>> words_;
};

}  // namespace ctrl_more
