/// @file
/// Real-time scheduling of a thread, if the user has the permission.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <functional>
#include <string>
#include <system_error>
#include <utility>

#include <alloca.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

namespace coglab_rt {

/// Gives the calling thread SCHED_FIFO with `priority` (1..99). Returns an empty string, or the
/// failure and its remedy.
std::string enterRealTime(int priority);

/// Locks present and future memory of the process (mlockall). Returns an empty string, or the
/// failure and its remedy.
std::string lockMemory();

/// A thread with a bounded stack. The half of the stack that it uses first is touched once before
/// its body runs, so that locked memory stays small and no page fault occurs later. Not copyable;
/// the owner must join().
class BoundedThread {
 public:
  BoundedThread() = default;
  BoundedThread(const BoundedThread&) = delete;
  BoundedThread& operator=(const BoundedThread&) = delete;
  ~BoundedThread() { join(); }

  /// Starts `body`. top and ps show `name` (at most 15 characters). @throws std::system_error
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

// Implementation

inline std::string enterRealTime(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return {};
  return "SCHED_FIFO priority " + std::to_string(priority) + " not granted (" +
         std::strerror(error) + "): answers may come late under load; give the binary cap_sys_nice";
}

inline std::string lockMemory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return std::string("mlockall not granted (") + std::strerror(errno) +
         "): page faults may delay answers; give the binary cap_ipc_lock or raise the memlock "
         "limit";
}

namespace detail {

/// Touches this number of bytes of the stack below the caller. It must return before the body runs:
/// memory that a frame allocates lies above the frames of the functions that it calls.
__attribute__((noinline)) inline void touchStack(std::size_t bytes) {
  auto* stack = static_cast<volatile char*>(alloca(bytes));
  for (std::size_t i = 0; i < bytes; i += 1024) stack[i] = 0;
}

/// Bytes of the calling thread's stack below its caller; 0 if unknown. Thread-local variables of
/// all libraries are in the stack, too, so it is less than was requested.
inline std::size_t stackLeft() {
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return 0;
  void* lowest = nullptr;
  std::size_t size = 0;
  const bool known = pthread_attr_getstack(&attributes, &lowest, &size) == 0;
  pthread_attr_destroy(&attributes);
  const auto* here = static_cast<const char*>(__builtin_frame_address(0));
  return known ? static_cast<std::size_t>(here - static_cast<const char*>(lowest)) : 0;
}

}  // namespace detail

inline void* BoundedThread::entry(void* self) {
  auto* thread = static_cast<BoundedThread*>(self);
  pthread_setname_np(pthread_self(), thread->name_.c_str());
  detail::touchStack(std::min(thread->stack_bytes_, detail::stackLeft()) / 2);
  thread->body_();
  return nullptr;
}

inline void BoundedThread::start(const char* name, std::size_t stack_bytes,
                                 std::function<void()> body) {
  join();
  name_ = std::string(name).substr(0, 15);
  stack_bytes_ = std::max<std::size_t>(stack_bytes, 128 * 1024);
  body_ = std::move(body);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_bytes_);
  const int error = pthread_create(&thread_, &attributes, &BoundedThread::entry, this);
  pthread_attr_destroy(&attributes);
  if (error != 0)
    throw std::system_error(error, std::generic_category(), "cannot start thread " + name_);
  running_ = true;
}

inline void BoundedThread::join() {
  if (!running_) return;
  pthread_join(thread_, nullptr);
  running_ = false;
}

}  // namespace coglab_rt
