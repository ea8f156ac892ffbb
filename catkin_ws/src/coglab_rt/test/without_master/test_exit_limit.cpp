/// A process that unregisters without an answer: time of its end, status and message.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "coglab_rt/ros/exit_limit.hpp"

namespace coglab_rt {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLong{60'000};  // nothing here lasts so long

/// An unregistration without an answer.
void waitForever(milliseconds limit) {
  endProcessWithin(limit);
  for (;;) std::this_thread::sleep_for(kLong);
}

/// The child's thread is started in the child alone, so that each death test begins a new program.
class ExitLimit : public ::testing::Test {
 protected:
  void SetUp() override { ::testing::FLAGS_gtest_death_test_style = "threadsafe"; }
};

TEST_F(ExitLimit, EndsWithStatusZeroAndAMessage) {
  EXPECT_EXIT(waitForever(milliseconds(50)), ::testing::ExitedWithCode(0), "ROS master.*\n$");
}

TEST_F(ExitLimit, NotBeforeItsTime) {
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EXIT(waitForever(milliseconds(400)), ::testing::ExitedWithCode(0), "does not answer");
  EXPECT_GE(std::chrono::steady_clock::now() - begin, milliseconds(400));
}

TEST_F(ExitLimit, AProcessThatEndsBeforeKeepsItsStatusWithoutAMessage) {
  const auto end_at_once = [] {
    endProcessWithin(kLong);
    std::_Exit(7);
  };
  EXPECT_EXIT(end_at_once(), ::testing::ExitedWithCode(7), "^$");
}

}  // namespace
}  // namespace coglab_rt
