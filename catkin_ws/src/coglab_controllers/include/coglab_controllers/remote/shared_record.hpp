/// @file
/// A record in memory that two processes share: one writes, the other reads, neither waits.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace coglab_controllers {

/// One value in shared memory with its number and a checksum of both.
///
/// The reader copies everything and accepts the copy only if the checksum is correct. So it needs
/// no lock and no order of the writer's stores: it refuses half-written records, random bytes and
/// fresh memory in the same way. Both sides are wait-free. A process that dies during a write does
/// no harm. Python has the same code in coglab/control/slot.py.
/// @tparam T trivially copyable, of 8-byte numbers only
template <typename T>
class SharedRecord {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % 8 == 0 && alignof(T) == 8);
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

 public:
  static constexpr std::size_t kWords = sizeof(T) / 8;

  /// Writes a value with its number. One writer.
  void write(const T& value, std::uint64_t number) noexcept {
    std::uint64_t words[kWords];
    std::memcpy(words, &value, sizeof(T));
    check_.store(checksum(words, number), std::memory_order_relaxed);
    number_.store(number, std::memory_order_relaxed);
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_relaxed);
  }

  /// Copies the value if it is complete. It tries once, because the next cycle reads again.
  /// @param number of the value that was read
  bool read(T& value, std::uint64_t& number) const noexcept {
    std::uint64_t words[kWords];
    const std::uint64_t seen = number_.load(std::memory_order_relaxed);
    const std::uint64_t check = check_.load(std::memory_order_relaxed);
    for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_relaxed);
    if (check != checksum(words, seen)) return false;
    std::memcpy(&value, words, sizeof(T));
    number = seen;
    return true;
  }

 private:
  /// Sum of all words, each times a different odd number; never 0 for empty memory.
  static std::uint64_t checksum(const std::uint64_t* words, std::uint64_t number) noexcept {
    std::uint64_t sum = 0x9e3779b97f4a7c15u + number * 0xd6e8feb86659fd93u;
    std::uint64_t factor = 1;
    for (std::size_t i = 0; i < kWords; ++i) {
      factor *= 0xda942042e4dd58b5u;
      sum += words[i] * factor;
    }
    return sum;
  }

  std::atomic<std::uint64_t> number_, check_;
  std::atomic<std::uint64_t> words_[kWords];
};

}  // namespace coglab_controllers
