/// @file
/// A queue that keeps its memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace coglab_contact {

/// First in, first out. Allocates only when it holds more entries than ever before.
template <typename T>
class Ring {
 public:
  explicit Ring(std::size_t capacity = 16) : slots_(capacity) {}

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  /// Entry `i`, 0 is the oldest.
  const T& operator[](std::size_t i) const { return slots_[(first_ + i) % slots_.size()]; }
  const T& front() const { return (*this)[0]; }
  const T& back() const { return (*this)[size_ - 1]; }

  void push(const T& value) {
    if (size_ == slots_.size()) {
      std::rotate(slots_.begin(), slots_.begin() + static_cast<std::ptrdiff_t>(first_),
                  slots_.end());
      first_ = 0;
      slots_.resize(2 * slots_.size());
    }
    slots_[(first_ + size_) % slots_.size()] = value;
    ++size_;
  }
  void pop() {
    first_ = (first_ + 1) % slots_.size();
    --size_;
  }
  void clear() { first_ = size_ = 0; }

 private:
  std::vector<T> slots_;
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace coglab_contact
