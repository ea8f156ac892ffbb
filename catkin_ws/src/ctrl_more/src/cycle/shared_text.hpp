#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>

namespace ctrl_more {

/// A short text that the control cycle writes and any thread reads, without locks. Cut to 119
/// characters.
class SharedText {
 public:
  /// Replaces the text (one writer only). No allocation.
  void set(const char* text) {
    std::array<std::uint64_t, kWords> words{};
    char* bytes = reinterpret_cast<char*>(words.data());
    for (std::size_t i = 0; i + 1 < kWords * 8 && text[i] != '\0'; ++i) bytes[i] = text[i];
    const std::uint64_t odd = sequence_.load(std::memory_order_relaxed) + 1;
    sequence_.store(odd, std::memory_order_relaxed);
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    sequence_.store(odd + 1, std::memory_order_release);
  }

  /// The text; "" if a writer was in the way a thousand times.
  std::string get() const {
    for (int attempt = 0; attempt < 1000; ++attempt) {
      const std::uint64_t first = sequence_.load(std::memory_order_acquire);
      if (first % 2 != 0) continue;
      std::array<std::uint64_t, kWords> words{};
      for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_acquire);
      if (sequence_.load(std::memory_order_relaxed) != first) continue;
      char bytes[kWords * 8];
      std::memcpy(bytes, words.data(), sizeof bytes);
      bytes[sizeof bytes - 1] = '\0';
      return bytes;
    }
    return "";
  }

 private:
  static constexpr std::size_t kWords = 15;
  std::atomic<std::uint64_t> sequence_{0};
  std::array<std::atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace ctrl_more
