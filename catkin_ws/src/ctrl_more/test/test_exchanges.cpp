// What carries texts, records and plans from the control cycle to other threads and back.
#include <atomic>
#include <chrono>
#include <thread>

#include "cycle/record_exchange.hpp"
#include "cycle/shared_text.hpp"
#include "cycle/steady_now.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(SharedTexts, AreKeptWholeUpTo119Characters) {
  SharedText shared;
  EXPECT_EQ(shared.get(), "");
  for (const std::size_t length : {1u, 8u, 117u, 118u, 119u}) {
    std::string text;
    for (std::size_t i = 0; i < length; ++i) text += static_cast<char>('a' + i % 26);
    shared.set(text.c_str());
    EXPECT_EQ(shared.get(), text);
    EXPECT_EQ(shared.get(), text) << "as often as it is asked";
  }
  for (const std::size_t length : {120u, 121u, 128u, 500u}) {
    shared.set(std::string(length, 'x').c_str());
    EXPECT_EQ(shared.get(), std::string(119, 'x'));
  }
  shared.set("short");
  EXPECT_EQ(shared.get(), "short") << "nothing is left of a longer one";
}

TEST(Records, CycleAndReaderNeverHaveTheSameBuffer) {
  RecordExchange exchange;
  unsigned reads = exchange.acquire();
  for (int i = 0; i < 50; ++i) {
    const unsigned writes = exchange.begin();
    EXPECT_LT(writes, 2u);
    EXPECT_NE(writes, reads);
    exchange.end(i % 3 != 0);
    if (i % 4 == 3) reads = exchange.acquire();
  }
}

TEST(Records, ReaderGetsTheBufferThatWasWrittenLast) {
  RecordExchange exchange;
  unsigned newest = exchange.begin();
  exchange.end(true);
  EXPECT_EQ(exchange.acquire(), newest);
  EXPECT_EQ(exchange.acquire(), newest) << "nothing newer";
  EXPECT_NE(exchange.begin(), newest) << "it is the reader's until the next call";
  exchange.end(false);
  EXPECT_EQ(exchange.acquire(), newest) << "a cycle that wrote nothing has nothing to show";
  for (int i = 0; i < 5; ++i) {
    newest = exchange.begin();
    exchange.end(true);
    EXPECT_EQ(exchange.begin(), newest) << "nobody asked: the buffers keep their places";
    exchange.end(false);
    EXPECT_EQ(exchange.acquire(), newest);
  }
}

TEST(Records, WhileACycleRunsTheOneBeforeIsReadAfterTheTimeLimit) {
  RecordExchange exchange;
  const unsigned first = exchange.begin();
  exchange.end(true);
  ASSERT_EQ(exchange.acquire(), first);
  const unsigned running = exchange.begin();
  EXPECT_EQ(exchange.acquire(0.0), first);
  exchange.end(true);
  EXPECT_EQ(exchange.acquire(), running);
}

TEST(Records, ReaderWaitsForTheEndOfARunningCycle) {
  RecordExchange exchange;
  const unsigned running = exchange.begin();
  std::atomic<bool> asks{false};
  unsigned got = 99;
  std::thread reader([&] {
    asks = true;
    got = exchange.acquire(60.0);
  });
  while (!asks) std::this_thread::yield();
  for (int i = 0; i < 2000; ++i) std::this_thread::yield();
  exchange.end(true);
  reader.join();
  EXPECT_EQ(got, running);
}

TEST(SteadyClock, IsTheOneOfTheStandardLibrary) {
  const auto now = [] {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  };
  for (int i = 0; i < 3; ++i) {
    const std::int64_t before = now(), read = steadyNow(), after = now();
    EXPECT_LE(before, read);
    EXPECT_LE(read, after);
  }
}

// Letters in every order of leaving and taking.
TEST(Mailbox, DeliversEachLetterOnceAndWhole) {
  Logger logger;
  RobotStates robot(&logger);
  robot.declare(RobotSource::Measured, "wrench", 2);
  const RobotSignal wrench = robot.find(RobotSource::Measured, "wrench");
  SignalMailbox mailbox(wrench);
  for (int i = 1; i <= 12; ++i) {
    for (int posted = 0; posted <= i % 3; ++posted) {
      const double letter[2] = {1.0 * i, 10.0 * i + posted};
      ASSERT_TRUE(mailbox.post(letter, 2, 100 * i + posted));
    }
    ASSERT_TRUE(mailbox.deliver(robot));
    for (int asked = 0; asked < 2; ++asked) {
      EXPECT_EQ(robot.view(wrench)[0], 1.0 * i);
      EXPECT_EQ(robot.view(wrench)[1], 10.0 * i + i % 3);
      EXPECT_EQ(robot.stamp(wrench), 100 * i + i % 3);
      EXPECT_FALSE(mailbox.deliver(robot)) << "there is nothing new";
    }
  }
  const double bad[2] = {1.0, std::nan("")};
  ASSERT_TRUE(mailbox.post(bad, 2, 5000));
  EXPECT_FALSE(mailbox.deliver(robot));
  EXPECT_EQ(robot.view(wrench)[0], 12.0);
}

}  // namespace
}  // namespace ctrl_more
