/// The FRI thread over real sockets on 127.0.0.1. Asserts outcomes and counters, no times.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "small_controller.hpp"
#include "udp_peer.hpp"

namespace lwr_fri_bridge {
namespace {

using test::anyPort;
using test::eventually;
using test::Peer;

/// The controller may be silent for this time, so that a busy computer does not disconnect it.
BridgeConfig patient(double receive_timeout = 5.0) {
  BridgeConfig config = test::defaultConfig();
  config.receive_timeout = receive_timeout;
  return config;
}

constexpr double kSilence = 2.0;  // s, where a test waits for the end of the connection

struct Fixture : testing::Test {
  Fixture() : bridge(patient(kSilence)), fri(bridge, options()), robot(0.005) { fri.start(); }
  static FriThreadOptions options() { return test::anyPort(); }
  Bridge bridge;
  FriThread fri;
  test::SmallController robot;
};

using FriThreadTest = Fixture;

TEST_F(FriThreadTest, AnswersToTheSourceOfTheDatagram) {
  Peer peer(fri.port());
  fri::CommandDatagram c{};
  for (int i = 0; i < 10; ++i) {
    const fri::MeasurementDatagram m = robot.measure();
    peer.send(m);
    ASSERT_TRUE(peer.receiveSoon(c));
    EXPECT_EQ(c.header.reflected, m.header.counter);
  }
  EXPECT_TRUE(eventually([&] { return fri.statistics().answers == 10; }));  // counted after sending
  EXPECT_NE(fri.statistics().peer.find("127.0.0.1:"), std::string::npos);
}

TEST_F(FriThreadTest, ASecondSenderIsIgnoredAndNamed) {
  Peer peer(fri.port()), other(fri.port());
  fri::CommandDatagram c{};
  peer.send(robot.measure());
  ASSERT_TRUE(peer.receiveSoon(c));
  other.send(robot.measure());
  EXPECT_TRUE(eventually([&] { return fri.statistics().foreign == 1; }));
  EXPECT_FALSE(other.receive(c));
  EXPECT_NE(fri.statistics().last_foreign.find("127.0.0.1:"), std::string::npos);
  EXPECT_NE(fri.statistics().last_foreign, fri.statistics().peer);
  // When the peer has fallen silent, another one may take its place.
  EXPECT_TRUE(eventually([&] { return fri.statistics().peer.empty(); }));
  other.send(robot.measure());
  EXPECT_TRUE(other.receiveSoon(c));
}

TEST(FriThreadPeer, OnlyTheControllersAddressIsAnswered) {
  Bridge bridge(patient(kSilence));
  FriThreadOptions options = Fixture::options();
  options.controller_address = "127.0.0.2";
  FriThread fri(bridge, options);
  fri.start();
  Peer other(fri.port()), controller(fri.port(), 0x7F000002);
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  other.send(robot.measure());  // first and valid, and still not the controller
  EXPECT_TRUE(eventually([&] { return fri.statistics().foreign == 1; }));
  controller.send(robot.measure());
  EXPECT_TRUE(controller.receiveSoon(c));
  EXPECT_TRUE(eventually([&] { return fri.statistics().peer.substr(0, 10) == "127.0.0.2:"; }));
  EXPECT_EQ(bridge.snapshot().session.accepted, 1U);
  EXPECT_TRUE(eventually([&] { return fri.statistics().peer.empty(); }));
  other.send(robot.measure());  // not after a silence either
  EXPECT_TRUE(eventually([&] { return fri.statistics().foreign == 2; }));
  options.controller_address = "cabinet";
  FriThread named(bridge, options);
  EXPECT_THROW(named.start(), std::runtime_error);
}

TEST_F(FriThreadTest, RubbishMakesNoPeerAndIsCounted) {
  Peer rubbish(fri.port()), peer(fri.port());
  std::vector<std::uint8_t> bytes(60000, 0x55);
  for (const std::size_t size : {0, 1, 375, 915, 917, 1024, 1025, 2000, 60000}) {
    rubbish.send(bytes.data(), static_cast<std::size_t>(size));
  }
  rubbish.send(bytes.data(), 916);
  EXPECT_TRUE(eventually([&] { return bridge.snapshot().session.rejected() == 10; }));
  EXPECT_TRUE(fri.statistics().peer.empty());
  peer.send(robot.measure());
  fri::CommandDatagram c{};
  EXPECT_TRUE(peer.receiveSoon(c));
}

TEST_F(FriThreadTest, SilenceIsDisconnection) {
  Peer peer(fri.port());
  peer.send(robot.measure());
  fri::CommandDatagram c{};
  ASSERT_TRUE(peer.receiveSoon(c));
  EXPECT_TRUE(eventually([&] { return bridge.snapshot().supervisor == SupervisorState::Monitor; }));
  EXPECT_TRUE(
      eventually([&] { return bridge.snapshot().supervisor == SupervisorState::Disconnected; }));
  const Outcome outcome = bridge.command("start");
  EXPECT_EQ(outcome.code, OutcomeCode::Disconnected);
}

/// The receive has a time-out, so the thread can end without a datagram.
TEST_F(FriThreadTest, StopsAtOnceWithoutDatagrams) {
  std::atomic<bool> stopped{false};
  std::thread stopper([&] {
    fri.stop();
    stopped = true;
  });
  EXPECT_TRUE(eventually([&] { return stopped.load(); }));
  if (!stopped) std::abort();  // joining would hang
  stopper.join();
}

TEST_F(FriThreadTest, APortInUseIsReported) {
  FriThreadOptions same = options();
  same.port = fri.port();
  Bridge other(test::defaultConfig());
  FriThread second(other, same);
  try {
    second.start();
    FAIL() << "bound twice";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(std::to_string(fri.port())), std::string::npos)
        << error.what();
  }
  same.address = "300.1.1.1";
  FriThread third(other, same);
  EXPECT_THROW(third.start(), std::runtime_error);
}

TEST_F(FriThreadTest, ARestartedThreadIsFoundWhereItWas) {
  const int port = fri.port();
  fri.stop();
  Bridge other(test::defaultConfig());
  FriThread again(other, options());
  again.start(port);
  EXPECT_EQ(again.port(), port);
  FriThread third(bridge, options());  // taken: any other one
  third.start(port);
  EXPECT_NE(third.port(), port);
  EXPECT_GT(third.port(), 0);
}

/// In a process without rights to priority or locked memory: 0 if it warned and still answers.
int answersWithoutRights() {
  if (geteuid() == 0 && setresuid(65534, 65534, 65534) != 0) return 10;
  rlimit none{0, 0};
  setrlimit(RLIMIT_RTPRIO, &none);
  setrlimit(RLIMIT_MEMLOCK, &none);
  if (coglab_rt::lockMemory().find("mlockall not granted") == std::string::npos) return 11;
  Bridge bridge(test::defaultConfig());
  FriThreadOptions options;
  options.port = 0;
  options.priority = 80;
  FriThread fri(bridge, options);
  if (fri.start().find("SCHED_FIFO priority 80 not granted") == std::string::npos) return 12;
  if (fri.statistics().real_time) return 13;
  Peer peer(fri.port());
  test::SmallController robot(0.005);
  fri::CommandDatagram c{};
  peer.send(robot.measure());
  return peer.receiveSoon(c) ? 0 : 14;
}

TEST(FriThreadRights, WithoutRightsItWarnsAndContinues) {
  const pid_t child = fork();
  if (child == 0) _exit(answersWithoutRights());
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(FriThreadTest, CommandReachesTheThreadAndComesBack) {
  Peer peer(fri.port());
  std::atomic<bool> end{false};
  std::thread controller([&] {
    while (!end) {
      peer.send(robot.measure());
      fri::CommandDatagram c{};
      robot.take(peer.receiveSoon(c) ? &c : nullptr);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  EXPECT_TRUE(eventually([&] { return bridge.snapshot().supervisor == SupervisorState::Monitor; }));
  const Outcome start = bridge.command("start");
  EXPECT_TRUE(start.success()) << describe(start);
  EXPECT_TRUE(bridge.command("hold").success());
  EXPECT_EQ(bridge.command("start").code, OutcomeCode::Held);
  EXPECT_TRUE(bridge.command("reset").success());
  const Outcome stop = bridge.command("stop");
  EXPECT_TRUE(stop.success()) << describe(stop);
  end = true;
  controller.join();
}

/// Of several waiting datagrams only the newest is answered; the controller gave up the others.
TEST(FriThreadRules, OnlyTheNewestWaitingDatagramIsAnswered) {
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

/// Each waiting datagram of the controller behind another one is a cycle of lateness; those of
/// other senders are not. Here four cycles of lateness end command mode.
TEST(FriThreadRules, WaitingDatagramsCountAsLatenessOfTheThread) {
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

}  // namespace
}  // namespace lwr_fri_bridge
