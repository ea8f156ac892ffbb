/// The mailboxes between the arm's thread and the control thread, with both threads at full speed.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/event_ring.hpp"

namespace coglab_rt {
namespace {

/// Every value that is read was written as a whole, and none comes before an older one.
TEST(Mailbox, AReaderSeesWholeValuesInOrder) {
  constexpr std::uint64_t kValues = 300'000;
  ArmMailboxes mailboxes;
  std::atomic<bool> over{false};
  std::thread writer([&] {
    RobotSample sample;
    for (std::uint64_t i = 1; i <= kValues; ++i) {
      sample.sequence = i;
      sample.position.setConstant(static_cast<double>(i));
      sample.commanded_acceleration.setConstant(static_cast<double>(i));
      sample.motion_epoch = static_cast<std::uint32_t>(i);
      mailboxes.publishSample(sample);
    }
    over = true;
  });
  std::uint64_t last = 0, seen = 0;
  bool whole = true, ordered = true;
  for (bool ended = false; !ended;) {
    ended = over;  // one more read after the last write
    RobotSample sample;
    if (mailboxes.newestSample(sample)) ++seen;
    const auto value = static_cast<double>(sample.sequence);
    whole = whole && (sample.position.array() == value).all() &&
            (sample.commanded_acceleration.array() == value).all() &&
            sample.motion_epoch == static_cast<std::uint32_t>(sample.sequence);
    ordered = ordered && sample.sequence >= last;
    last = sample.sequence;
  }
  writer.join();
  EXPECT_TRUE(whole);
  EXPECT_TRUE(ordered);
  EXPECT_EQ(last, kValues);
  EXPECT_GT(seen, 0U);
}

/// A queue loses nothing and changes no order, and says so when it is full.
TEST(Mailbox, AQueueKeepsEverythingInOrder) {
  constexpr int kValues = 200'000;
  EventRing<int, 64> queue;
  std::thread writer([&] {
    for (int i = 0; i < kValues;) {
      if (queue.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  int expected = 0;
  for (int value = 0; expected < kValues;) {
    if (queue.pop(value)) {
      ASSERT_EQ(value, expected);
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  writer.join();
}

}  // namespace
}  // namespace coglab_rt
