/// A thread of the real-time side.
#include <gtest/gtest.h>

#include <cstdint>

#include <sys/mman.h>
#include <unistd.h>

#include "coglab_rt/real_time.hpp"

namespace coglab_rt {
namespace {

/// Lies in the stack of every thread of this program, as do those of the libraries of a node.
thread_local volatile char of_the_thread[96 * 1024];

TEST(BoundedThread, WhatThreadLocalVariablesTakeOfTheStackIsNotTouched) {
  bool ran = false;
  BoundedThread thread;
  thread.start("narrow", 128 * 1024, [&ran] { ran = of_the_thread[0] == 0; });
  thread.join();
  EXPECT_TRUE(ran);
}

/// The pages that a body uses first are there before it runs: no page fault comes later.
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

}  // namespace
}  // namespace coglab_rt
