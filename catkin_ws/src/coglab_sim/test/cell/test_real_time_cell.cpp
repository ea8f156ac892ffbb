#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <netinet/in.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include "coglab_sim/cell.hpp"
#include "coglab_sim/fri_socket.hpp"
#include "coglab_sim/real_time_cell.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

/// A UDP socket on the loopback, which the caller closes, and its port.
std::pair<int, std::uint16_t> loopbackSocket() {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof own;
  EXPECT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&own), length), 0);
  EXPECT_EQ(getsockname(fd, reinterpret_cast<sockaddr*>(&own), &length), 0);
  return {fd, ntohs(own.sin_port)};
}

}  // namespace

TEST(FriSocket, SendsReceivesAndReportsTooLongDatagrams) {
  const auto soon = [] { return std::chrono::steady_clock::now() + std::chrono::seconds(5); };
  const auto [taken, port] = loopbackSocket();
  close(taken);
  FriSocket one("127.0.0.1", port), two("127.0.0.1");
  const std::array<std::uint8_t, 5> sent{1, 2, 3, 4, 5};
  ASSERT_TRUE(two.send(sent.data(), sent.size(), port));
  std::array<std::uint8_t, 5> bytes{};
  EXPECT_EQ(one.receive(bytes.data(), bytes.size(), soon()), 5);
  EXPECT_EQ(bytes, sent);
  ASSERT_TRUE(two.send(sent.data(), sent.size(), port));
  EXPECT_EQ(one.receive(bytes.data(), 4, soon()), 5);
  ASSERT_TRUE(two.send(sent.data(), sent.size(), port));
  EXPECT_EQ(one.receive(bytes.data(), 3, soon()), 4) << "cut off";
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(one.receive(bytes.data(), 5, begin + std::chrono::milliseconds(30)), -1);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(30));
  EXPECT_EQ(one.receive(bytes.data(), 5, begin), -1);
  EXPECT_FALSE(two.send(sent.data(), 70000, port)) << "the system refuses";
  for (const char* host : {"localhost", "", "300.0.0.1"})
    EXPECT_THROW(FriSocket(host, 0), std::runtime_error) << host;
  try {
    FriSocket("127.0.0.1", port);
    FAIL() << "bound twice";
  } catch (const std::runtime_error& error) {
    const std::string words = "127.0.0.1 from port " + std::to_string(port) + ": ";
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

/// No faster than real time times the factor; no answer is needed, and a flood of datagrams stops
/// nothing. A busy computer may lose periods.
TEST(RealTimeCell, TheFactorScalesTimeAndAFloodDoesNotStopIt) {
  for (const double factor : {0.5, 1.0, 4.0}) {
    const auto [fd, port] = loopbackSocket();
    sockaddr_in peer{};
    socklen_t length = sizeof peer;
    CellConfig config;
    config.urdf = URDF;
    config.krc.period = 0.02;
    RealTimeCell cell(config, "127.0.0.1", port, factor);
    cell.start();
    std::array<char, 1024> bytes{};
    EXPECT_EQ(
        recvfrom(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&peer), &length),
        916);
    const auto begin = std::chrono::steady_clock::now();
    const double simulated_before = cell.snapshot().truth.time;
    double simulated = 0.0, real = 0.0;
    while (real < 0.4 || simulated < 0.1) {
      for (int i = 0; i < 50; ++i)
        sendto(fd, bytes.data(), 376, 0, reinterpret_cast<sockaddr*>(&peer), sizeof peer);
      simulated = cell.snapshot().truth.time - simulated_before;
      real = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    }
    cell.stop();
    close(fd);
    EXPECT_TRUE(cell.failure().empty()) << cell.failure();
    EXPECT_LT(simulated, factor * real * 1.05 + 0.05) << factor;
  }
  CellConfig config;
  config.urdf = URDF;
  EXPECT_THROW(RealTimeCell(config, "127.0.0.1", 1, 0.001), std::invalid_argument);
}

/// The reported latency is in time of the cell, for any factor. Every answer is held for a share of
/// the cell's period, which is the smallest possible latency; a busy computer adds to it.
TEST(RealTimeCell, TheLatencyOfAnswersIsMeasuredInTimeOfTheCell) {
  constexpr double kPeriod = 0.1;
  const auto told_at = [](double factor, double held) {
    const auto [fd, port] = loopbackSocket();
    sockaddr_in peer{};
    socklen_t length = sizeof peer;
    const timeval limit{5, 0};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    CellConfig config;
    config.urdf = URDF;
    config.krc.period = kPeriod;
    RealTimeCell cell(config, "127.0.0.1", port, factor);
    cell.start();
    fri::MeasurementDatagram measurement{};
    std::array<std::uint8_t, fri::kMeasurementSize> bytes{};
    // Until three of its last hundred measurements were answered: on a busy machine some answers
    // come too late to be taken.
    for (std::uint16_t counter = 1; counter <= 200 && measurement.answer_rate < 0.025F; ++counter) {
      const auto receive = [&, fd = fd](int flags) {
        length = sizeof peer;
        return recvfrom(fd, bytes.data(), bytes.size(), flags, reinterpret_cast<sockaddr*>(&peer),
                        &length);
      };
      EXPECT_EQ(receive(0), static_cast<ssize_t>(bytes.size()));
      while (receive(MSG_DONTWAIT) > 0) continue;  // only an answer to the newest one is taken
      EXPECT_TRUE(fri::decode(bytes.data(), bytes.size(), measurement));
      std::this_thread::sleep_for(std::chrono::duration<double>(held / factor));
      fri::CommandDatagram answer{};
      answer.header = fri::commandHeader(counter, measurement.header.counter);
      std::array<std::uint8_t, fri::kCommandSize> command{};
      fri::encode(answer, command.data());
      sendto(fd, command.data(), command.size(), 0, reinterpret_cast<sockaddr*>(&peer),
             sizeof peer);
    }
    cell.stop();
    close(fd);
    return static_cast<double>(measurement.latency);
  };
  for (const auto& [factor, share] : {std::pair{0.5, 0.5}, {2.0, 0.25}}) {
    double told = 0.0;
    for (int run = 0; run < 5 && told == 0.0; ++run) told = told_at(factor, share * kPeriod);
    EXPECT_GE(told, 0.999 * share * kPeriod) << factor << " times real time";
  }
}

/// A busy computer answers three periods late. If simulated time may wait, no answer is lost.
TEST(RealTimeCell, SimulatedTimeWaitsForLateAnswers) {
  const auto [fd, port] = loopbackSocket();
  const timeval limit{5, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  CellConfig config;
  config.urdf = URDF;
  config.krc.period = 0.01;
  RealTimeCell cell(config, "127.0.0.1", port, 1.0);
  cell.waitForAnswers(true);
  cell.start();
  std::uint32_t misses = 0;
  for (std::uint16_t counter = 1; counter <= 20; ++counter) {
    sockaddr_in peer{};
    socklen_t length = sizeof peer;
    std::array<std::uint8_t, fri::kMeasurementSize> bytes{};
    fri::MeasurementDatagram measurement{};
    ASSERT_EQ(
        recvfrom(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&peer), &length),
        static_cast<ssize_t>(bytes.size()));
    ASSERT_TRUE(fri::decode(bytes.data(), bytes.size(), measurement));
    if (counter == 10) misses = measurement.miss_counter;
    if (counter > 10) {
      EXPECT_EQ(measurement.miss_counter, misses) << counter;
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
    }
    fri::CommandDatagram answer{};
    answer.header = fri::commandHeader(counter, measurement.header.counter);
    std::array<std::uint8_t, fri::kCommandSize> command{};
    fri::encode(answer, command.data());
    sendto(fd, command.data(), command.size(), 0, reinterpret_cast<sockaddr*>(&peer), sizeof peer);
  }
  cell.stop();
  close(fd);
}

TEST(Cell, LateStandInDoesNotBlameThePc) {
  CellConfig config;
  config.urdf = URDF;
  Cell cell(config);
  for (int i = 0; i < 50; ++i) cell.advance(true);
  const auto counted = cell.controller().statistics().missCounter();
  for (int i = 0; i < 50; ++i) cell.advance(false);
  EXPECT_EQ(cell.controller().statistics().missCounter(), counted);
}

/// A request that timed out is never executed and does not use freed memory.
TEST(RealTimeCell, ARequestThatTimedOutIsWithdrawn) {
  CellConfig config;
  config.urdf = URDF;
  RealTimeCell cell(config, "127.0.0.1", 9, 1.0);
  std::atomic<int> done{0};
  cell.start();
  cell.apply([&](Cell&) { ++done; });
  cell.applyLater(0.0, [](Cell&) { std::this_thread::sleep_for(std::chrono::milliseconds(300)); });
  const auto ask = [&] {
    const auto object = std::make_unique<std::vector<int>>(1000, 1);  // gone after the call
    const std::vector<int>& used = *object;
    cell.apply([&](Cell&) { done += used[999]; }, 0.02);
  };
  bool refused = false;
  for (int i = 0; i < 50 && !refused; ++i) {
    try {
      done = 0;
      ask();
    } catch (const std::runtime_error& error) {
      refused = true;
      EXPECT_NE(std::string(error.what()).find("nothing was changed"), std::string::npos)
          << error.what();
    }
  }
  EXPECT_TRUE(refused);
  cell.apply([&](Cell&) {}, 5.0);  // the thread goes on
  cell.stop();
  EXPECT_EQ(done, 0);
}

/// A real robot controller is a separate computer that no program on the PC delays.
TEST(RealTimeCell, ItsThreadIsRealTimeIfGrantedAndTheFactorAllowsIt) {
  CellConfig config;
  config.urdf = URDF;
  for (const auto& [factor, priority] : {std::pair{1.0, 60}, {1.0, 0}, {2.0, 60}}) {
    RealTimeCell cell(config, "127.0.0.1", 9, factor);
    const std::string normal = cell.start(priority);
    int policy = -1;
    sched_param parameters{};
    cell.apply([&](Cell&) { pthread_getschedparam(pthread_self(), &policy, &parameters); }, 5.0);
    EXPECT_EQ(policy, normal.empty() ? SCHED_FIFO : SCHED_OTHER) << factor << " " << normal;
    EXPECT_EQ(parameters.sched_priority, normal.empty() ? 60 : 0) << factor;
    const bool asked = priority > 0 && factor <= 1.0;
    // Only a computer that refuses it may say no where it was asked for.
    EXPECT_TRUE(asked ? normal.empty() || normal.find("granted") != std::string::npos
                      : !normal.empty())
        << normal;
    EXPECT_THROW(cell.start(), std::logic_error);
  }
}

/// Clients with a hard-wired port of the controller can be used.
TEST(RealTimeCell, SendsFromTheSourcePortAsked) {
  const auto [fd, client_port] = loopbackSocket();
  const auto [free_port, port] = loopbackSocket();
  CellConfig config;
  config.urdf = URDF;
  try {
    RealTimeCell(config, "127.0.0.1", client_port, 1.0, port);
    FAIL() << "bound twice";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(std::to_string(port)), std::string::npos);
  }
  close(free_port);
  RealTimeCell cell(config, "127.0.0.1", client_port, 1.0, port);
  cell.start();
  std::array<char, 1024> bytes{};
  sockaddr_in peer{};
  socklen_t length = sizeof peer;
  const timeval limit{5, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  EXPECT_EQ(
      recvfrom(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&peer), &length),
      916);
  EXPECT_EQ(ntohs(peer.sin_port), port);
  cell.stop();
  close(fd);
}
