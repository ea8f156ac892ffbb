/// FRI session: verdicts, counters, losses, and a million bad datagrams.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <deque>
#include <random>
#include <vector>

#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

using fri::Session;
using fri::Verdict;
using test::SmallController;

using Bytes = std::vector<std::uint8_t>;

Bytes bytesOf(const fri::MeasurementDatagram& m) {
  Bytes bytes(fri::kMeasurementSize);
  fri::encode(m, bytes.data());
  return bytes;
}

fri::Reception receive(Session& session, const fri::MeasurementDatagram& m) {
  fri::MeasurementDatagram out;
  const Bytes bytes = bytesOf(m);
  return session.receive(bytes.data(), bytes.size(), out);
}

TEST(Session, CountsWhatItRejects) {
  Session session(false);
  SmallController robot(0.005);
  fri::MeasurementDatagram m = robot.measure();
  fri::MeasurementDatagram out;
  Bytes bytes = bytesOf(m);
  EXPECT_EQ(session.receive(bytes.data(), 915, out).verdict, Verdict::WrongSize);
  EXPECT_EQ(session.receive(bytes.data(), 0, out).verdict, Verdict::WrongSize);
  m.header.size = 900;
  EXPECT_EQ(receive(session, m).verdict, Verdict::WrongSize);
  m.header.size = 916;
  m.header.id = 0x2005;
  EXPECT_EQ(receive(session, m).verdict, Verdict::WrongId);
  m.header.id = 0x2006;
  m.measured_position[3] = NAN;
  EXPECT_EQ(receive(session, m).verdict, Verdict::Implausible);
  m.measured_position[3] = 0.0F;
  m.state = 0;  // OFF never appears on the wire
  EXPECT_EQ(receive(session, m).verdict, Verdict::Implausible);
  m.state = 1;
  EXPECT_EQ(receive(session, m).verdict, Verdict::Accepted);
  EXPECT_EQ(receive(session, m).verdict, Verdict::Duplicate);
  m.header.counter = static_cast<std::uint16_t>(m.header.counter - 1);
  EXPECT_EQ(receive(session, m).verdict, Verdict::OutOfOrder);
  EXPECT_EQ(session.counters().wrong_size, 3U);
  EXPECT_EQ(session.counters().wrong_id, 1U);
  EXPECT_EQ(session.counters().implausible, 2U);
  EXPECT_EQ(session.counters().duplicate, 1U);
  EXPECT_EQ(session.counters().out_of_order, 1U);
  EXPECT_EQ(session.counters().accepted, 1U);
  EXPECT_EQ(session.counters().rejected(), 8U);
}

TEST(Session, FindsGapsAcrossTheWrapOfTheCounter) {
  Session session(false);
  SmallController robot(0.001);
  fri::MeasurementDatagram m = robot.measure();
  m.header.counter = 65533;
  EXPECT_TRUE(receive(session, m).fresh_session);
  m.header.counter = 2;  // 65534, 65535, 0, 1 are lost
  const fri::Reception r = receive(session, m);
  EXPECT_EQ(r.verdict, Verdict::Accepted);
  EXPECT_EQ(r.cycles, 5U);
  EXPECT_EQ(session.counters().lost_measurements, 4U);
}

/// friOpen sets the period; while it is open in command mode another one is no true datagram.
TEST(Session, ThePeriodChangesInMonitorModeOnly) {
  Session session(false);
  SmallController robot(0.001);
  fri::MeasurementDatagram m = robot.measure();
  receive(session, m);
  m.measurement_period = m.command_period = 0.005F;
  ++m.header.counter;
  const fri::Reception r = receive(session, m);
  EXPECT_EQ(r.verdict, Verdict::Accepted);
  EXPECT_TRUE(r.new_period);
  EXPECT_FALSE(r.fresh_session);
  EXPECT_EQ(session.counters().new_periods, 1U);
  m.state = static_cast<std::uint16_t>(fri::FriState::Command);
  ++m.header.counter;
  EXPECT_FALSE(receive(session, m).new_period);
  m.command_period = 0.002F;
  ++m.header.counter;
  EXPECT_EQ(receive(session, m).verdict, Verdict::Implausible);
  EXPECT_EQ(session.counters().implausible, 1U);
}

/// A rejected datagram does not change the measurement: state and joints do not jump to zero.
TEST(Session, ARejectedDatagramLeavesTheMeasurement) {
  Session session(false);
  SmallController robot(0.005);
  fri::MeasurementDatagram kept;
  const Bytes good = bytesOf(robot.measure());
  ASSERT_EQ(session.receive(good.data(), good.size(), kept).verdict, Verdict::Accepted);
  const Bytes before = bytesOf(kept);
  for (const std::size_t size : {0, 8, 100, 915, 916, 917}) {
    Bytes bad(1000, 0xA5);
    session.receive(bad.data(), size, kept);
    EXPECT_EQ(bytesOf(kept), before) << size;
  }
}

/// Fills `buffer` with a bad datagram and returns its size: random, with a true header, or one of
/// `past` again, whole, truncated or oversized.
std::size_t badDatagram(std::mt19937& random, const std::deque<Bytes>& past,
                        std::vector<std::uint8_t>& buffer) {
  const auto dice = [&random](int n) {
    return static_cast<int>(random() % static_cast<unsigned>(n));
  };
  const auto scramble = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; i += 4) {
      const std::uint32_t word = random();
      std::memcpy(&buffer[i], &word, 4);
    }
  };
  const int way = dice(6);
  if (way == 0) {
    const auto size = static_cast<std::size_t>(dice(1500));
    scramble(0, size);
    return size;
  }
  if (way == 1) {
    scramble(8, fri::kMeasurementSize);
    const fri::Header h = fri::measurementHeader(static_cast<std::uint16_t>(random()), 0);
    std::memcpy(buffer.data(), &h, sizeof h);
    return fri::kMeasurementSize;
  }
  if (past.empty()) return 1;
  const Bytes& old = past[static_cast<std::size_t>(dice(static_cast<int>(past.size())))];
  std::copy(old.begin(), old.end(), buffer.begin());
  const int kind = dice(3);
  return kind == 0   ? old.size()
         : kind == 1 ? static_cast<std::size_t>(dice(916))
                     : 917 + static_cast<std::size_t>(dice(100));
}

/// A million bad datagrams between good ones while the arm moves: no crash, all counted, no jump in
/// the answers.
TEST(Session, AMillionBadDatagramsMakeNoLeap) {
  const double period = 0.001;
  Bridge bridge(test::defaultConfig());
  SmallController robot(period);
  for (int i = 0; i < 5; ++i) robot.cycle(bridge);
  ASSERT_TRUE(test::runEvent(bridge, robot, "start").success());

  std::mt19937 random(99);
  const auto dice = [&random](int n) {
    return static_cast<int>(random() % static_cast<unsigned>(n));
  };
  std::deque<Bytes> past;
  constexpr int kBad = 1'000'000;
  std::uint64_t bad = 0, bad_answered = 0;
  Vector7 velocity = Vector7::Zero(), last = robot.setPoint();
  const JointLimits& limits = bridge.config().limits;
  std::uint64_t good = bridge.snapshot().session.accepted;
  const std::uint64_t rejected_before = bridge.snapshot().session.rejected();
  fri::CommandDatagram answer{};
  std::vector<std::uint8_t> buffer(2048);
  while (bad < kBad) {
    for (int k = 0; k < 20; ++k, ++bad) {
      const std::size_t size = badDatagram(random, past, buffer);
      if (bridge.answer(buffer.data(), size, robot.now() + 1000 * k, answer)) ++bad_answered;
    }
    if (dice(400) == 0) {
      for (int j = 0; j < 7; ++j) velocity[j] = 0.3 * (dice(201) - 100) / 100.0;
    }
    test::drive(bridge, robot, velocity);
    const fri::MeasurementDatagram m = robot.measure();
    const Bytes bytes = bytesOf(m);
    ASSERT_TRUE(bridge.answer(bytes.data(), bytes.size(), robot.now(), answer));
    ++good;
    robot.take(&answer);
    past.push_back(bytes);
    if (past.size() > 200) past.pop_front();
    const Vector7 step = robot.setPoint() - last;
    last = robot.setPoint();
    for (int j = 0; j < 7; ++j) ASSERT_LE(std::abs(step[j]), limits.velocity[j] * period + 1e-6);
  }
  const Snapshot s = bridge.snapshot();
  EXPECT_EQ(bad_answered, 0U);
  EXPECT_EQ(s.session.accepted, good);
  EXPECT_EQ(s.session.rejected() - rejected_before, bad);
  EXPECT_EQ(s.supervisor, SupervisorState::Command);
  EXPECT_GT(s.session.duplicate, 0U);
  EXPECT_GT(s.session.out_of_order, 0U);
  EXPECT_GT(s.session.implausible, 0U);
}

}  // namespace
}  // namespace lwr_fri_bridge
