/// @file
/// Passes the newest value from one thread to another.
#pragma once

#include <atomic>
#include <cstdint>

namespace coglab_rt {

/// A value that one thread writes and one thread reads, both wait-free. It has three slots; the
/// reader gets the newest complete one.
template <typename T>
class TripleBuffer {
 public:
  TripleBuffer() = default;
  /// @param initial value of every slot, for types whose assignment allocates unless sizes match
  explicit TripleBuffer(const T& initial) : slots_{initial, initial, initial} {}

  /// Publishes a value (writer thread only).
  void write(const T& value) {
    back() = value;
    publish();
  }

  /// The slot that publish() will publish (writer thread only). It contains an old value.
  T& back() { return slots_[write_]; }
  /// Number of that slot, 0 to 2.
  std::uint8_t backIndex() const { return write_; }
  /// Publishes back() (writer thread only).
  void publish() {
    write_ =
        middle_.exchange(static_cast<std::uint8_t>(write_ | kFresh), std::memory_order_acq_rel) &
        kIndex;
  }

  /// Copies the newest value (reader thread only). Returns true if it is newer than the last one
  /// read.
  bool read(T& value) {
    const bool fresh = take();
    value = front();
    return fresh;
  }

  /// Makes the newest value the front (reader thread only). Returns true if there was a newer one.
  bool take() {
    const bool fresh = (middle_.load(std::memory_order_relaxed) & kFresh) != 0;
    if (fresh) read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    return fresh;
  }
  /// The value that take() selected (reader thread only).
  const T& front() const { return slots_[read_]; }
  /// Number of its slot, 0 to 2.
  std::uint8_t frontIndex() const { return read_; }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  T slots_[3];
  std::uint8_t write_ = 0, read_ = 1;
  std::atomic<std::uint8_t> middle_{2};
};

}  // namespace coglab_rt
