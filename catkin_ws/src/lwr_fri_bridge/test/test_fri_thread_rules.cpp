/// The FRI thread's rules one by one: idle ticks, the newest of several datagrams, ports and
/// addresses, and what its statistics tell.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include "small_controller.hpp"
#include "udp_peer.hpp"

namespace lwr_fri_bridge {
namespace {

using test::anyPort;
using test::eventually;
using test::Peer;

/// The controller may be silent for long, so that a busy computer does not disconnect it.
BridgeConfig patient() {
  BridgeConfig config = test::defaultConfig();
  config.receive_timeout = 5.0;
  return config;
}

TEST(FriThreadRules, IdleTicksAreToldAndKeepThePeer) {
  Bridge bridge(patient());
  std::atomic<int> answers{0}, idle{0};
  FriThreadOptions options = anyPort();
  options.after_answer = [&](bool answered) { ++(answered ? answers : idle); };
  FriThread fri(bridge, options);
  EXPECT_EQ(fri.start(), "");                          // no priority was wanted: nothing to warn of
  EXPECT_TRUE(eventually([&] { return idle >= 2; }));  // before anybody has sent
  EXPECT_EQ(answers, 0);
  EXPECT_EQ(bridge.snapshot().supervisor, SupervisorState::Disconnected);
  Peer peer(fri.port()), other(fri.port());
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  peer.send(robot.measure());
  ASSERT_TRUE(peer.receiveSoon(c));
  EXPECT_TRUE(eventually([&] { return answers == 1; }));
  const int before = idle;
  EXPECT_TRUE(eventually([&] { return idle >= before + 3; }));
  EXPECT_EQ(answers, 1);
  EXPECT_TRUE(bridge.connected());
  other.send(robot.measure());
  EXPECT_TRUE(eventually([&] { return fri.statistics().foreign == 1; }));
  const FriThreadStatistics told = fri.statistics();
  EXPECT_EQ(told.peer, peer.name());
  EXPECT_EQ(told.last_foreign, other.name());
  EXPECT_EQ(told.answers, 1U);
  EXPECT_EQ(told.superseded, 0U);
  EXPECT_EQ(told.send_errors, 0U);
  EXPECT_FALSE(told.real_time);
  EXPECT_GT(told.longest_answer_time, 0.0);
  EXPECT_EQ(fri.statistics().longest_answer_time, told.longest_answer_time);
  EXPECT_EQ(fri.statistics(true).longest_answer_time, told.longest_answer_time);
  EXPECT_EQ(fri.statistics().longest_answer_time, 0.0);
}

TEST(FriThreadRules, BeforeTheFirstDatagramNobodyIsNamed) {
  Bridge bridge(patient());
  FriThread fri(bridge, anyPort());
  EXPECT_EQ(fri.port(), 0);
  fri.start();
  EXPECT_GT(fri.port(), 1023);  // any free one; none is preferred
  const FriThreadStatistics told = fri.statistics();
  EXPECT_EQ(told.answers + told.superseded + told.foreign + told.send_errors, 0U);
  EXPECT_EQ(told.peer, "");
  EXPECT_EQ(told.last_foreign, "");
  EXPECT_EQ(told.mean_answer_time, 0.0);
  EXPECT_EQ(told.longest_answer_time, 0.0);
}

/// Of several that wait only the newest is answered: the controller has given up the others.
TEST(FriThreadRules, TheNewestOfThoseThatWaitIsAnswered) {
  Bridge bridge(patient());
  std::atomic<bool> held{false}, waits{false};
  std::atomic<int> idle{0};
  FriThreadOptions options = anyPort();
  options.after_answer = [&](bool answered) {  // off the beat of 1 ms, however quick the test is
    for (int i = 0; i < 1000 && answered && held; ++i) {
      waits = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    idle += answered ? 0 : 1;
  };
  FriThread fri(bridge, options);
  fri.start();
  Peer peer(fri.port());
  test::SmallController robot(0.001);
  fri::CommandDatagram c{};
  held = true;
  peer.send(robot.measure());
  ASSERT_TRUE(peer.receiveSoon(c));
  ASSERT_TRUE(eventually([&] { return waits.load(); }));
  fri::MeasurementDatagram newest{};
  for (int i = 0; i < 4; ++i) peer.send(newest = robot.measure());
  held = false;
  ASSERT_TRUE(peer.receiveSoon(c));
  EXPECT_EQ(c.header.reflected, newest.header.counter);
  EXPECT_TRUE(eventually([&] { return fri.statistics().answers == 2; }));
  EXPECT_EQ(fri.statistics().superseded, 3U);
  EXPECT_EQ(bridge.snapshot().session.lost_measurements, 3U);
  EXPECT_EQ(fri.statistics().foreign, 0U);
  const int before = idle;  // what is counted is shown then
  EXPECT_TRUE(eventually([&] { return idle > before; }));
  EXPECT_EQ(bridge.snapshot().session.rejected(), 0U);  // they were not even looked at
}

/// Each of the controller's datagrams that waits behind another is a cycle of lateness; those of
/// somebody else are none. Four cycles of it are what costs command mode here.
TEST(FriThreadRules, WhatWaitsForTheThreadIsItsLateness) {
  Bridge bridge(patient());
  std::atomic<bool> held{false}, waits{false};
  std::atomic<int> served{0};
  FriThreadOptions options = anyPort();
  options.after_answer = [&](bool answered) {
    for (int i = 0; i < 1000 && answered && held; ++i) {
      waits = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));  // off the beat of 5 ms
    }
    served += answered ? 1 : 0;
  };
  FriThread fri(bridge, options);
  fri.start();
  Peer peer(fri.port()), other(fri.port());
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  const std::uint32_t ticket = bridge.submit("start");
  Outcome start;
  int sent = 0;
  for (; sent < 200 && start.code == OutcomeCode::Pending; ++sent) {
    peer.send(robot.measure());
    ASSERT_TRUE(peer.receiveSoon(c));
    robot.take(&c);
    start = bridge.outcome(ticket);
  }
  ASSERT_TRUE(start.success()) << describe(start);
  ASSERT_TRUE(eventually([&] { return served == sent; }));  // it waits for the next one
  held = true;
  peer.send(robot.measure());
  ASSERT_TRUE(peer.receiveSoon(c));
  robot.take(&c);
  ASSERT_TRUE(eventually([&] { return waits.load(); }));
  for (int i = 0; i < 4; ++i) {
    peer.send(robot.measure());
    robot.take(nullptr);
    if (i < 2) other.send(robot.measure());
  }
  robot.state = fri::FriState::Monitor;
  peer.send(robot.measure());
  held = false;
  ASSERT_TRUE(peer.receiveSoon(c));
  EXPECT_TRUE(eventually([&] { return bridge.snapshot().fall_backs == 1; }));
  EXPECT_EQ(bridge.snapshot().loss.cause, LossCause::ComputerLate);
}

/// A controller on 127.0.0.1 runs here, so its silence is this computer's doing.
TEST(FriThreadRules, AControllerOnTheLoopbackRunsOnThisComputer) {
  BridgeConfig config = test::defaultConfig();
  config.receive_timeout = 1.0;
  Bridge bridge(config);
  FriThread fri(bridge, anyPort());
  fri.start();
  Peer peer(fri.port());
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  const std::uint32_t ticket = bridge.submit("start");
  Outcome start;
  for (int i = 0; i < 200 && start.code == OutcomeCode::Pending; ++i) {
    peer.send(robot.measure());
    ASSERT_TRUE(peer.receiveSoon(c));
    robot.take(&c);
    start = bridge.outcome(ticket);
  }
  ASSERT_TRUE(start.success()) << describe(start);
  peer.send(robot.measure());
  EXPECT_TRUE(eventually([&] { return bridge.snapshot().fall_backs == 1; }));
  EXPECT_TRUE(bridge.snapshot().loss.byComputer());
  EXPECT_TRUE(eventually([&] { return fri.statistics().peer.empty(); }));
}

std::string refusal(const FriThreadOptions& options) {
  Bridge bridge(patient());
  FriThread fri(bridge, options);
  try {
    fri.start();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(FriThreadRules, PortsAndAddressesThatAreNoneAreNamed) {
  for (const int port : {-1, 65536}) {
    FriThreadOptions options = anyPort();
    options.port = port;
    EXPECT_EQ(refusal(options),
              "fri_port = " + std::to_string(port) + " is outside its range 0..65535");
  }
  FriThreadOptions last = anyPort();
  last.port = 65535;
  EXPECT_EQ(refusal(last).find("range"), std::string::npos);
  FriThreadOptions options = anyPort();
  options.address = "300.1.1.1";
  EXPECT_EQ(refusal(options),
            "fri_address = '300.1.1.1' is not an IPv4 address such as 192.168.0.20");
  options = anyPort();
  options.controller_address = "cabinet";
  EXPECT_EQ(refusal(options).find("controller_address = 'cabinet' is not an IPv4 address"), 0U);
  options.controller_address = "127.0.0.2";
  EXPECT_EQ(refusal(options), "");
}

TEST(FriThreadRules, APortInUseIsNamedWithTheReason) {
  Bridge bridge(patient());
  FriThread fri(bridge, anyPort());
  fri.start();
  FriThreadOptions same = anyPort();
  same.port = fri.port();
  EXPECT_EQ(refusal(same), "FRI socket: cannot bind 127.0.0.1:" + std::to_string(fri.port()) +
                               " (Address already in use); is another bridge running, is "
                               "fri_address an address of this computer?");
}

/// A port that is asked for is bound; the preferred one counts only where any is good.
TEST(FriThreadRules, ThePreferredPortCountsOnlyIfAnyIsGood) {
  Bridge bridge(patient());
  FriThread one(bridge, anyPort()), two(bridge, anyPort());
  one.start();
  two.start();
  const int first = one.port(), second = two.port();
  EXPECT_NE(first, second);
  one.stop();
  two.stop();
  FriThreadOptions options = anyPort();
  options.port = first;
  options.controller_address = "127.0.0.1";
  FriThread fixed(bridge, options);
  fixed.start(second);
  EXPECT_EQ(fixed.port(), first);
  EXPECT_EQ(fixed.priority(), 0);
  EXPECT_EQ(fixed.controllerAddress(), "127.0.0.1");
  for (const int none : {0, -5, 65536 + second}) {
    FriThread any(bridge, anyPort());
    any.start(none);
    EXPECT_GT(any.port(), 0);
    EXPECT_NE(any.port(), first);
    if (none > 0) {
      EXPECT_NE(any.port(), second) << none;
    }
  }
}

TEST(FriThreadRules, AThreadThatWasStoppedStartsAgain) {
  Bridge bridge(patient());
  FriThread fri(bridge, anyPort());
  fri.stop();  // nothing to stop
  fri.start();
  fri.stop();
  fri.stop();
  fri.start(fri.port());
  Peer peer(fri.port());
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  peer.send(robot.measure());
  EXPECT_TRUE(peer.receiveSoon(c));
}

TEST(AnswerTimes, NothingWasTakenYet) {
  AnswerTimes times;
  EXPECT_EQ(times.mean(), 0.0);
  EXPECT_EQ(times.longest(true), 0.0);
  times.add(0.002F);
  times.add(0.001F);
  EXPECT_FLOAT_EQ(times.longest(true), 0.002F);
  EXPECT_EQ(times.longest(false), 0.0);
  EXPECT_NEAR(times.mean(), 0.001999, 1e-9);  // a thousandth of the difference
}

}  // namespace
}  // namespace lwr_fri_bridge
