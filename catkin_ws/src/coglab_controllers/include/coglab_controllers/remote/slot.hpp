/// @file
/// The place where one Python process connects to the control cycle.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "coglab_controllers/remote/layout.hpp"

namespace coglab_controllers {

/// Shared memory of one slot, and the thread that hands it out.
///
/// The robot makes the memory (memfd, sealed: no process can shorten it, so no read of the cycle
/// can fail) and passes it over a local socket with the abstract name
/// `coglab/<user>/<pid of the robot>/<slot>`. Through the socket the kernel identifies the other
/// process and closes the connection when it dies. One process at a time; a second one is refused
/// with the number of the first.
///
/// ask(), read() and connected() are for the cycle: wait-free, no system call. The process polls
/// for questions about once a millisecond, because waking it would be a system call.
class RemoteSlot {
 public:
  /// @param id of the controller
  /// @throws std::runtime_error if the memory or the socket cannot be made
  RemoteSlot(const std::string& id, RemoteKind kind);
  ~RemoteSlot();
  RemoteSlot(const RemoteSlot&) = delete;
  RemoteSlot& operator=(const RemoteSlot&) = delete;

  /// Publishes a question.
  void ask(const RemoteQuestion& question) noexcept {
    segment_->question.write(question, ++asked_);
  }
  /// Copies the newest answer. Returns true if it is complete and was not read before.
  bool read(RemoteAnswer& answer) noexcept {
    if (!connected()) return false;
    std::uint64_t number = 0;
    if (!segment_->answer.read(answer, number) || number == read_) return false;
    read_ = number;
    return true;
  }
  /// True while a process holds the slot.
  bool connected() const noexcept { return owner_.load(std::memory_order_acquire) != 0; }
  /// Number of the process that holds the slot; 0: none.
  int owner() const noexcept { return owner_.load(std::memory_order_acquire); }
  const std::string& address() const { return address_; }

 private:
  void serve();
  void greet(int connection);
  std::string judge(const std::string& hello, unsigned user) const;
  void clear() noexcept;

  RemoteKind kind_;
  std::string address_;
  int memory_ = -1, listener_ = -1, end_ = -1;
  int client_ = -1;  // the thread's
  RemoteSegment* segment_ = nullptr;
  std::uint64_t asked_ = 0, read_ = 0;  // the cycle's
  std::atomic<int> owner_{0};
  std::thread thread_;
};

}  // namespace coglab_controllers
