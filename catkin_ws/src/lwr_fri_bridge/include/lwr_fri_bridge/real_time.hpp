/// @file
/// Real-time scheduling of a thread, for those who have the right to it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <thread>

#include <pthread.h>

namespace lwr_fri_bridge {

/// Gives the calling thread SCHED_FIFO with `priority` (1..99). Returns an empty string, or what
/// failed and what to do.
std::string enterRealTime(int priority);

/// Locks present and future memory of the process (mlockall). Returns an empty string, or what
/// failed and what to do.
std::string lockMemory();

/// A thread with a bounded stack, the half of which that it uses first is touched once before it
/// runs, so that locked memory stays small and no page fault comes later. Not copyable; the owner
/// must join().
class BoundedThread {
 public:
  BoundedThread() = default;
  BoundedThread(const BoundedThread&) = delete;
  BoundedThread& operator=(const BoundedThread&) = delete;
  ~BoundedThread() { join(); }

  /// Starts `body`. `name` (at most 15 characters) shows in top and ps. @throws std::system_error
  void start(const char* name, std::size_t stack_bytes, std::function<void()> body);
  void join();
  bool running() const { return running_; }

 private:
  static void* entry(void* self);

  std::function<void()> body_;
  std::string name_;
  std::size_t stack_bytes_ = 0;
  pthread_t thread_{};
  bool running_ = false;
};

}  // namespace lwr_fri_bridge
