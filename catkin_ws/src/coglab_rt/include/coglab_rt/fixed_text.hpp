/// @file
/// Text of bounded length that can be composed inside the control cycle.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

namespace coglab_rt {

/// A text of at most N-1 characters, always terminated. Never allocates; longer text is cut.
template <std::size_t N>
class FixedText {
 public:
  FixedText() { text_[0] = '\0'; }
  FixedText(const char* text) { *this << text; }  // NOLINT: converts like a string on purpose

  /// Clears the text.
  void clear() {
    size_ = 0;
    text_[0] = '\0';
  }

  /// Appends a terminated text; null appends nothing.
  FixedText& operator<<(const char* text) {
    while (text != nullptr && *text != '\0' && size_ + 1 < N) text_[size_++] = *text++;
    text_[size_] = '\0';
    return *this;
  }

  /// Appends a number with three decimals, without the C library (which may allocate or lock).
  FixedText& operator<<(double value) {
    if (!std::isfinite(value)) return *this << (std::isnan(value) ? "nan" : "inf");
    if (value < 0.0) {
      *this << "-";
      value = -value;
    }
    if (value > 1e15) return *this << ">1e15";
    const std::uint64_t milli = static_cast<std::uint64_t>(value * 1000.0 + 0.5);
    *this << (milli / 1000) << ".";
    const char decimals[4] = {static_cast<char>('0' + milli / 100 % 10),
                              static_cast<char>('0' + milli / 10 % 10),
                              static_cast<char>('0' + milli % 10), '\0'};
    return *this << decimals;
  }

  /// Appends a whole number.
  FixedText& operator<<(std::uint64_t value) {
    char digits[21];
    std::size_t at = sizeof(digits) - 1;
    digits[at] = '\0';
    do {
      digits[--at] = static_cast<char>('0' + value % 10);
      value /= 10;
    } while (value != 0);
    return *this << static_cast<const char*>(digits + at);
  }

  bool empty() const { return size_ == 0; }
  const char* c_str() const { return text_.data(); }
  std::string str() const { return std::string(text_.data(), size_); }
  bool operator==(const FixedText& other) const {
    if (size_ != other.size_) return false;
    for (std::size_t i = 0; i < size_; ++i) {
      if (text_[i] != other.text_[i]) return false;
    }
    return true;
  }
  bool operator!=(const FixedText& other) const { return !(*this == other); }

 private:
  std::size_t size_ = 0;
  std::array<char, N> text_;
};

/// Id of a primitive or controller.
using Name = FixedText<64>;

}  // namespace coglab_rt
