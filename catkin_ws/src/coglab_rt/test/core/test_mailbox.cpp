/// The mailboxes between the arm's thread and the control thread, with both threads at full speed.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <thread>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/event_ring.hpp"

namespace coglab_rt {
namespace {

/// Every value that is read is complete, and values arrive in order.
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

/// A queue keeps all entries in order, and reports when it is full.
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

/// A value that does something while it is copied to the reader: there the writer may be at work.
struct Watched {
  int value = 0;
  const std::function<void()>* during_copy = nullptr;

  Watched() = default;
  Watched(int value) : value(value) {}  // NOLINT: converts like a number on purpose
  Watched(const Watched&) = default;
  Watched& operator=(const Watched& other) {
    value = other.value;
    if (during_copy != nullptr) {
      (*during_copy)();
      EXPECT_EQ(other.value, value) << "the writer wrote to what the reader reads";
    }
    return *this;
  }
};

TEST(Mailbox, TheWriterNeverWritesTheSlotBeingRead) {
  TripleBuffer<Watched> buffer;
  int last = 0;
  const std::function<void()> write_thrice = [&] {
    for (int i = 0; i < 3; ++i) buffer.write(++last);
  };
  Watched read;
  EXPECT_FALSE(buffer.read(read));  // nothing was written
  EXPECT_EQ(read.value, 0);
  read.during_copy = &write_thrice;
  for (int turn = 0; turn < 5; ++turn) {
    EXPECT_EQ(buffer.read(read), turn > 0);  // three more are written with each
    EXPECT_EQ(read.value, 3 * turn);
  }
  read.during_copy = nullptr;
  EXPECT_TRUE(buffer.read(read));
  EXPECT_EQ(read.value, 15);
  EXPECT_FALSE(buffer.read(read));  // the newest again, and it is said that it is not new
  EXPECT_EQ(read.value, 15);
}

TEST(Mailbox, AFullQueueRefusesTheNewestAndCountsIt) {
  EventRing<int, 4> queue;
  int value = -1;
  EXPECT_FALSE(queue.pop(value));
  EXPECT_EQ(value, -1);
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.push(10 * round + i));
    EXPECT_EQ(queue.dropped(), 2U * static_cast<unsigned>(round));
    EXPECT_FALSE(queue.push(98));
    EXPECT_FALSE(queue.push(99));
    EXPECT_EQ(queue.dropped(), 2U * static_cast<unsigned>(round) + 2U);
    for (int i = 0; i < 4; ++i) {
      EXPECT_TRUE(queue.pop(value));
      EXPECT_EQ(value, 10 * round + i);
    }
    EXPECT_FALSE(queue.pop(value));
  }
}

}  // namespace
}  // namespace coglab_rt
