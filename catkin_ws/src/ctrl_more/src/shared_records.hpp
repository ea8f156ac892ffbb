#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace ctrl_more {

/// Records of doubles that the control cycle writes and any thread reads, without locks on either
/// side. Two records take turns: the writer fills one while the last complete one stays readable;
/// a reader that was overtaken tries again.
class SharedRecords {
 public:
  /// @param size doubles per record
  explicit SharedRecords(std::size_t size)
      : size_(size), words_(std::make_unique<std::atomic<double>[]>(2 * size)) {
    for (std::size_t i = 0; i < 2 * size; ++i) words_[i].store(0.0, std::memory_order_relaxed);
    closed_ = words_.get();
    open_ = closed_ + size;
  }

  /// Doubles per record.
  std::size_t size() const { return size_; }

  /// The record being made, for the writer; stores must release.
  std::atomic<double>* making() { return open_; }

  /// Writes one number of the record being made (one writer only).
  void put(std::size_t index, double value) {
    open_[index].store(value, std::memory_order_release);
  }

  /// One number of the record being made, for the writer.
  double made(std::size_t index) const { return open_[index].load(std::memory_order_relaxed); }

  /// One number of the last complete record, for the writer.
  double last(std::size_t index) const { return closed_[index].load(std::memory_order_relaxed); }

  /// One number of the record before the last, for the writer; gone with the next put().
  double previous(std::size_t index) const { return made(index); }

  /// Completes the record being made.
  void close() {
    ++count_;
    std::swap(open_, closed_);
    shared_count_.store(count_, std::memory_order_release);
  }

  /// Reads the last complete record (any thread).
  /// @param out resized to the record
  /// @param tries attempts before giving up
  /// @return false if a writer was in the way every time
  bool read(std::vector<double>& out, int tries = 1000) const {
    out.resize(size_);
    for (int attempt = 0; attempt < tries; ++attempt) {
      const std::uint64_t count = shared_count_.load(std::memory_order_acquire);
      const std::atomic<double>* words = words_.get() + (count & 1) * size_;
      for (std::size_t i = 0; i < size_; ++i) out[i] = words[i].load(std::memory_order_acquire);
      if (shared_count_.load(std::memory_order_relaxed) == count) return true;
    }
    return false;
  }

 private:
  std::size_t size_;
  std::unique_ptr<std::atomic<double>[]> words_;
  std::atomic<double>* open_;    // being made
  std::atomic<double>* closed_;  // last complete
  std::uint64_t count_ = 0;      // of complete ones; the writer's own copy
  std::atomic<std::uint64_t> shared_count_{0};
};

}  // namespace ctrl_more
