// Counts calls that a control cycle must not make. These functions replace those of libc and
// libpthread: they count, then call the original.
#include "forbidden_calls.hpp"

#include <dlfcn.h>
#include <pthread.h>
#include <sched.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>
#include <typeinfo>

namespace {

thread_local bool counting = false;
thread_local bool in_throw = false;
thread_local forbidden::Counts counts;

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

void countAllocation() {
  if (!counting) return;
  if (in_throw) {
    ++counts.of_throw;
  } else {
    ++counts.allocations;
  }
}
void countLock() {
  if (counting && !in_throw) ++counts.locks;
}
void countSyscall() {
  if (counting) ++counts.syscalls;
}

}  // namespace

namespace forbidden {
void start() {
  counts = {};
  counting = true;
}
Counts stop() {
  counting = false;
  return counts;
}
}  // namespace forbidden

extern "C" {

void* __libc_malloc(std::size_t size);
void __libc_free(void* pointer);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  countAllocation();
  return __libc_malloc(size);
}
void free(void* pointer) {
  if (pointer) countAllocation();
  __libc_free(pointer);
}
void* calloc(std::size_t count, std::size_t size) {
  countAllocation();
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  countAllocation();
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  countAllocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  countAllocation();
  *pointer = __libc_memalign(alignment, size);
  return *pointer ? 0 : 12;
}

// The C++ runtime allocates the exception itself, frees it, and looks for handlers under the
// dynamic linker's lock; this is counted apart.
void* __cxa_allocate_exception(std::size_t size) noexcept {
  static const auto real = next<void* (*)(std::size_t)>("__cxa_allocate_exception");
  in_throw = true;
  return real(size);
}
void __cxa_end_catch() {
  static const auto real = next<void (*)()>("__cxa_end_catch");
  real();
  in_throw = false;
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static const auto real = next<int (*)(pthread_mutex_t*)>("pthread_mutex_lock");
  countLock();
  return real(mutex);
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) {
  static const auto real = next<int (*)(pthread_mutex_t*)>("pthread_mutex_trylock");
  countLock();
  return real(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  static const auto real = next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_rdlock");
  countLock();
  return real(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  static const auto real = next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_wrlock");
  countLock();
  return real(lock);
}
int pthread_cond_signal(pthread_cond_t* condition) {
  static const auto real = next<int (*)(pthread_cond_t*)>("pthread_cond_signal");
  countSyscall();
  return real(condition);
}
int pthread_cond_broadcast(pthread_cond_t* condition) {
  static const auto real = next<int (*)(pthread_cond_t*)>("pthread_cond_broadcast");
  countSyscall();
  return real(condition);
}
ssize_t write(int file, const void* data, std::size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, std::size_t)>("write");
  countSyscall();
  return real(file, data, size);
}
ssize_t read(int file, void* data, std::size_t size) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t)>("read");
  countSyscall();
  return real(file, data, size);
}
int nanosleep(const timespec* wanted, timespec* left) {
  static const auto real = next<int (*)(const timespec*, timespec*)>("nanosleep");
  countSyscall();
  return real(wanted, left);
}
int clock_nanosleep(clockid_t clock, int flags, const timespec* wanted, timespec* left) {
  static const auto real =
      next<int (*)(clockid_t, int, const timespec*, timespec*)>("clock_nanosleep");
  countSyscall();
  return real(clock, flags, wanted, left);
}
int sched_yield() {
  static const auto real = next<int (*)()>("sched_yield");
  countSyscall();
  return real();
}

}  // extern "C"
