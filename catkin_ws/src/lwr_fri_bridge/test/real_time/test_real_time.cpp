/// One FRI tick allocates nothing, locks nothing and makes no system call, in every mode, including
/// requests, losses and bad datagrams.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>

#include <dlfcn.h>
#include <pthread.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include "small_controller.hpp"

namespace {

thread_local bool counting = false;
thread_local std::size_t allocations = 0, locks = 0;

// System calls: Linux' syscall user dispatch raises SIGSYS for each while the selector says so; the
// handler counts it and lets it pass. At most one is counted per tick.
volatile char selector = 0;
std::size_t system_calls = 0;

bool dispatchSystemCalls() {
#if defined(__x86_64__)
  struct sigaction action = {};
  action.sa_sigaction = [](int, siginfo_t*, void* context) {
    selector = 0;
    ++system_calls;
    // Back onto the instruction, which is two bytes long: the call is made after all.
    static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_RIP] -= 2;
  };
  action.sa_flags = SA_SIGINFO;
  sigemptyset(&action.sa_mask);
  constexpr int kSetUserDispatch = 59, kOn = 1;  // <linux/prctl.h> of newer headers names them
  return sigaction(SIGSYS, &action, nullptr) == 0 &&
         prctl(kSetUserDispatch, kOn, 0UL, 0UL, &selector) == 0;
#else
  return false;
#endif
}

void count(bool on) {
  selector = on ? 1 : 0;
  counting = on;
}

}  // namespace

// The C library's allocator with a counter in front: catches new, malloc and what libraries do.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  if (counting) ++allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) {
  if (counting) ++allocations;
  return __libc_realloc(p, size);
}
int pthread_mutex_lock(pthread_mutex_t* mutex) {
  using Lock = int (*)(pthread_mutex_t*);
  static const Lock original = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  if (counting) ++locks;
  return original(mutex);
}
}

namespace lwr_fri_bridge {
namespace {

TEST(RealTime, TheCountersCount) {
  pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  const bool dispatched = dispatchSystemCalls();
  count(true);
  delete new int(3);
  void* volatile p = std::malloc(10);
  std::free(p);
  pthread_mutex_lock(&mutex);
  static_cast<void>(getppid());
  count(false);
  pthread_mutex_unlock(&mutex);
  EXPECT_GE(allocations, 1U);
  EXPECT_EQ(locks, 1U);
  EXPECT_EQ(system_calls, dispatched ? 1U : 0U);
}

TEST(RealTime, ATickAllocatesAndLocksNothingAndCallsNoSystem) {
  const bool dispatched = dispatchSystemCalls();
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    Bridge bridge(test::defaultConfig());
    test::SmallController robot(0.005);
    allocations = locks = system_calls = 0;
    const auto tick = [&](bool lose) {
      const fri::MeasurementDatagram m = robot.measure();
      std::uint8_t bytes[fri::kMeasurementSize];
      fri::encode(m, bytes);
      fri::CommandDatagram answer{};
      count(true);
      bridge.answer(bytes, 700, robot.now(), answer);
      const bool answered = !lose && bridge.answer(bytes, sizeof bytes, robot.now(), answer);
      bridge.idle(robot.now());
      count(false);
      robot.take(answered ? &answer : nullptr);
    };
    for (int i = 0; i < 5; ++i) tick(false);
    bridge.submit(mode);
    tick(false);
    const std::uint32_t start = bridge.submit("start");
    for (int i = 0; i < 10; ++i) tick(false);
    ASSERT_TRUE(bridge.outcome(start).success());
    for (int i = 0; i < 500; ++i) {
      test::drive(bridge, robot, Vector7::Constant(i % 200 < 100 ? 1.0 : -1.0));
      tick(i % 20 == 0);
    }
    bridge.submit("hold");
    for (int i = 0; i < 50; ++i) tick(false);
    bridge.submit("reset");
    bridge.submit("stop");
    for (int i = 0; i < 50; ++i) tick(false);
    EXPECT_EQ(robot.state, fri::FriState::Monitor) << mode;
    EXPECT_EQ(allocations, 0U) << mode;
    EXPECT_EQ(locks, 0U) << mode;
    EXPECT_EQ(system_calls, 0U) << mode;
  }
  if (!dispatched) GTEST_SKIP() << "system calls were not counted: no syscall user dispatch here";
}

}  // namespace
}  // namespace lwr_fri_bridge
