/// A thread of the real-time side.
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <system_error>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "coglab_rt/real_time.hpp"

namespace coglab_rt {
namespace {

/// Lies in the stack of every thread of this program, as do those of the libraries of a node.
thread_local volatile char of_the_thread[96 * 1024];

TEST(BoundedThread, StackOfThreadLocalVariablesIsNotTouched) {
  bool ran = false;
  BoundedThread thread;
  thread.start("narrow", 128 * 1024, [&ran] { ran = of_the_thread[0] == 0; });
  thread.join();
  EXPECT_TRUE(ran);
}

/// The pages that a body uses first are mapped before it runs, so no page fault occurs later.
TEST(BoundedThread, TheStackBelowTheBodyIsTouchedBeforeItRuns) {
  constexpr std::size_t kStack = 4096 * 1024;  // no stack that the C library keeps from before
  std::size_t present = 0, looked_at = 0;
  BoundedThread thread;
  thread.start("touched", kStack, [&] {
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const auto here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) / page * page;
    for (std::size_t depth = page; depth < kStack * 4 / 10; depth += page) {
      unsigned char resident = 0;
      ++looked_at;
      if (mincore(reinterpret_cast<void*>(here - depth), page, &resident) == 0 && (resident & 1))
        ++present;
    }
  });
  thread.join();
  EXPECT_GT(looked_at, 300U);
  EXPECT_EQ(present, looked_at);
}

TEST(BoundedThread, RunsUntilItIsJoinedAndAnotherStartWaitsForIt) {
  std::atomic<int> ran{0};
  std::atomic<bool> seen{false};
  BoundedThread thread;
  EXPECT_FALSE(thread.running());
  thread.join();  // of none
  thread.start("first", 0, [&ran, &seen] {
    while (!seen) usleep(100);
    usleep(20'000);  // a second one that did not wait would begin before this has run
    ++ran;
  });
  EXPECT_TRUE(thread.running());
  seen = true;
  thread.start("second", 0, [&ran] { ran = ran == 1 ? 2 : -1; });
  thread.join();
  EXPECT_FALSE(thread.running());
  EXPECT_EQ(ran, 2);
}

TEST(BoundedThread, OneThatCannotBeStartedIsNamedAndDoesNotRun) {
  BoundedThread thread;
  try {
    thread.start("vast", std::size_t{1} << 60, [] {});
    FAIL();
  } catch (const std::system_error& error) {
    EXPECT_NE(std::string(error.what()).find("thread vast"), std::string::npos) << error.what();
    EXPECT_NE(error.code().value(), 0);
  }
  EXPECT_FALSE(thread.running());
}

/// Half of what is left is touched; what lies deeper is not, so that locked memory stays small.
TEST(BoundedThread, TheLowerHalfOfTheStackIsNotTouched) {
  constexpr std::size_t kStack = 16'384 * 1024;  // no stack that the C library keeps from before
  std::size_t present = 0;
  BoundedThread thread;
  thread.start("untouched", kStack, [&] {
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const auto here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) / page * page;
    for (std::size_t depth = kStack * 6 / 10; depth < kStack * 9 / 10; depth += page) {
      unsigned char resident = 0;
      if (mincore(reinterpret_cast<void*>(here - depth), page, &resident) == 0 && (resident & 1))
        ++present;
    }
  });
  thread.join();
  EXPECT_EQ(present, 0U);
}

/// In a separate thread, because the priority ends with it. The result must report the true state.
TEST(RealTime, TheGrantedPriorityIsTheRequestedOne) {
  BoundedThread thread;
  thread.start("priority", 0, [] {
    const std::string refused = enterRealTime(7);
    int policy = -1;
    sched_param parameters{};
    ASSERT_EQ(pthread_getschedparam(pthread_self(), &policy, &parameters), 0);
    EXPECT_EQ(policy == SCHED_FIFO, refused.empty()) << refused;
    EXPECT_EQ(parameters.sched_priority, refused.empty() ? 7 : 0);
  });
  thread.join();
}

/// In a separate process, because its memory is locked. The result must report the true state.
TEST(RealTime, MemoryIsLockedOrAWarningIsReturned) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const std::string refused = lockMemory();
    const bool granted = mlockall(MCL_CURRENT) == 0;
    const bool told = refused.find("mlockall not granted (") == 0 &&
                      refused.find("cap_ipc_lock") != std::string::npos;
    _exit(granted ? (refused.empty() ? 0 : 1) : (told ? 0 : 2));
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace coglab_rt
