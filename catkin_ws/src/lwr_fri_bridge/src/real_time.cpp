#include "lwr_fri_bridge/real_time.hpp"

#include <algorithm>
#include <cstring>
#include <system_error>

#include <alloca.h>
#include <sched.h>
#include <sys/mman.h>

namespace lwr_fri_bridge {

std::string enterRealTime(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return {};
  return "SCHED_FIFO priority " + std::to_string(priority) + " not granted (" +
         std::strerror(error) + "): answers may come late under load; give the binary cap_sys_nice";
}

std::string lockMemory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return std::string("mlockall not granted (") + std::strerror(errno) +
         "): page faults may delay answers; give the binary cap_ipc_lock or raise the memlock "
         "limit";
}

namespace {

/// Touches so much of the stack below the caller. It must return before the body runs: what a frame
/// has allocated lies above the frames of what it calls.
__attribute__((noinline)) void touchStack(std::size_t bytes) {
  auto* stack = static_cast<volatile char*>(alloca(bytes));
  for (std::size_t i = 0; i < bytes; i += 1024) stack[i] = 0;
}

}  // namespace

void* BoundedThread::entry(void* self) {
  auto* thread = static_cast<BoundedThread*>(self);
  pthread_setname_np(pthread_self(), thread->name_.c_str());
  touchStack(thread->stack_bytes_ / 2);
  thread->body_();
  return nullptr;
}

void BoundedThread::start(const char* name, std::size_t stack_bytes, std::function<void()> body) {
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

void BoundedThread::join() {
  if (!running_) return;
  pthread_join(thread_, nullptr);
  running_ = false;
}

}  // namespace lwr_fri_bridge
