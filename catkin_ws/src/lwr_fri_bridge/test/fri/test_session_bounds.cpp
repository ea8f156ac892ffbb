/// Limits of the plausibility checks of an FRI session: periods, angles, jumps, gaps and restarts.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "small_controller.hpp"

namespace lwr_fri_bridge::fri {
namespace {

/// A session that has accepted one datagram in monitor mode.
struct Line {
  explicit Line(double period, bool lenient = false) : session(lenient), robot(period) {
    m = robot.measure();
    m.header.counter = 30000;
    first = receive();
  }
  Reception receive() {
    std::uint8_t bytes[kMeasurementSize];
    encode(m, bytes);
    MeasurementDatagram out;
    return session.receive(bytes, sizeof bytes, out);
  }
  Verdict next(int cycles = 1) {
    m.header.counter = static_cast<std::uint16_t>(m.header.counter + cycles);
    return receive().verdict;
  }
  Session session;
  test::SmallController robot;
  MeasurementDatagram m{};
  Reception first;
};

TEST(Plausible, EnumerationsHaveTheirBounds) {
  const MeasurementDatagram good = test::SmallController(0.005).measure();
  ASSERT_TRUE(plausible(good));
  for (unsigned value = 0; value < 6; ++value) {
    MeasurementDatagram m = good;
    m.state = static_cast<std::uint16_t>(value);
    EXPECT_EQ(plausible(m), value == 1 || value == 2) << value;
    m = good;
    m.quality = static_cast<std::uint16_t>(value);
    EXPECT_EQ(plausible(m), value <= 3) << value;
    m = good;
    m.control = static_cast<std::uint16_t>(value);
    EXPECT_EQ(plausible(m), value <= 3) << value;
  }
}

/// FRI offers 1..100 ms; the command period counts, or the other one where it is not filled.
TEST(Plausible, OneOfThePeriodsIsOneThatFriOffers) {
  MeasurementDatagram m = test::SmallController(0.005).measure();
  for (const float bad : {0.0F, 0.0004F, -0.005F, 0.12F, NAN}) {
    m.command_period = m.measurement_period = bad;
    EXPECT_FALSE(plausible(m)) << bad;
    m.measurement_period = 0.005F;
    EXPECT_TRUE(plausible(m)) << bad;
    EXPECT_DOUBLE_EQ(cycleTimeOf(m), 0.005) << bad;
    m.command_period = 0.002F;
    m.measurement_period = bad;
    EXPECT_TRUE(plausible(m)) << bad;
    EXPECT_DOUBLE_EQ(cycleTimeOf(m), 0.002) << bad;
  }
  for (const float good : {0.0005F, 0.0006F, 0.001F, 0.1F, 0.11F}) {
    m.command_period = m.measurement_period = good;
    EXPECT_TRUE(plausible(m)) << good;
    EXPECT_NEAR(cycleTimeOf(m), static_cast<double>(good), 1e-8);
  }
  m.command_period = 0.001F;
  m.measurement_period = 0.005F;
  EXPECT_EQ(cycleTimeOf(m), 1000 * 1e-6);  // whole microseconds, not what float32 makes of them
}

TEST(Plausible, AnglesLieWithinATurnAndNothingIsInfinite) {
  const MeasurementDatagram good = test::SmallController(0.005).measure();
  for (const int joint : {0, 3, 6}) {
    for (const float sign : {-1.0F, 1.0F}) {
      for (const bool within : {true, false}) {
        const float angle = sign * (within ? 6.39F : 6.41F);
        MeasurementDatagram m = good;
        m.measured_position[joint] = angle;
        EXPECT_EQ(plausible(m), within) << joint;
        m = good;
        m.commanded_position[joint] = angle;
        EXPECT_EQ(plausible(m), within) << joint;
        m = good;
        m.commanded_position_offset[joint] = 2.0F * angle;
        EXPECT_EQ(plausible(m), within) << joint;
      }
    }
  }
  using Set = std::function<void(MeasurementDatagram&, float)>;
  const std::vector<Set> fields = {
      [](MeasurementDatagram& m, float v) { m.measured_position[6] = v; },
      [](MeasurementDatagram& m, float v) { m.commanded_position[0] = v; },
      [](MeasurementDatagram& m, float v) { m.commanded_position_offset[6] = v; },
      [](MeasurementDatagram& m, float v) { m.measured_torque[0] = v; },
      [](MeasurementDatagram& m, float v) { m.measured_torque[6] = v; },
      [](MeasurementDatagram& m, float v) { m.external_torque[6] = v; },
      [](MeasurementDatagram& m, float v) { m.external_wrench[5] = v; },
      [](MeasurementDatagram& m, float v) { m.commanded_frame[11] = v; },
      [](MeasurementDatagram& m, float v) { m.commanded_frame_offset[11] = v; }};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    for (const float value : {NAN, INFINITY, -INFINITY}) {
      MeasurementDatagram m = good;
      fields[i](m, value);
      EXPECT_FALSE(plausible(m)) << i << " " << value;
    }
  }
}

TEST(SessionBounds, AnswersCountUpFromOneAndGapsAreToldFromThem) {
  Line line(0.005);
  const Header answer = line.session.nextHeader();
  EXPECT_EQ(answer.counter, 1);
  EXPECT_EQ(answer.reflected, 30000);
  line.m.header.reflected = 1;
  line.m.header.counter = 30001;
  const Reception arrived = line.receive();
  EXPECT_TRUE(arrived.answer_arrived);
  EXPECT_FALSE(arrived.fresh_session);
  EXPECT_EQ(arrived.cycles, 1U);
  EXPECT_FALSE(arrived.gap());
  EXPECT_EQ(line.session.nextHeader().counter, 2);
  line.m.header.reflected = 2;
  line.m.header.counter = 30003;
  const Reception late = line.receive();
  EXPECT_TRUE(late.answer_arrived);
  EXPECT_EQ(late.cycles, 2U);
  EXPECT_TRUE(late.gap());
  EXPECT_EQ(line.session.counters().lost_measurements, 1U);
  EXPECT_EQ(line.session.counters().lost_answers, 0U);
}

TEST(SessionBounds, AGapIsUpToAThousandDatagrams) {
  for (const auto& [cycles, verdict] :
       {std::pair{1000, Verdict::Accepted}, std::pair{1001, Verdict::OutOfOrder},
        std::pair{0, Verdict::Duplicate}, std::pair{-1, Verdict::OutOfOrder},
        std::pair{32767, Verdict::OutOfOrder}, std::pair{-32768, Verdict::OutOfOrder}}) {
    Line line(0.001);
    EXPECT_EQ(line.next(cycles), verdict) << cycles;
  }
}

TEST(SessionBounds, ARestartNeedsThreeInARowAndATenthOfASecond) {
  for (const auto& [period, refused] :
       {std::pair{0.1, 2}, std::pair{0.05, 2}, std::pair{0.02, 4}, std::pair{0.001, 99}}) {
    Line line(period);
    line.m.header.counter = 7;
    int count = 0;
    Reception r;
    while ((r = line.receive()).verdict == Verdict::OutOfOrder && count < 200) {
      ++count;
      ++line.m.header.counter;
    }
    EXPECT_EQ(count, refused) << period;
    EXPECT_EQ(r.verdict, Verdict::Accepted);
    EXPECT_TRUE(r.fresh_session);
    EXPECT_EQ(r.cycles, 1U);
    EXPECT_FALSE(r.new_period);
    EXPECT_EQ(line.session.counters().restarts, 1U);
    EXPECT_EQ(line.session.counters().out_of_order, static_cast<std::uint64_t>(refused));
    EXPECT_EQ(line.session.counters().lost_measurements, 0U);
  }
}

TEST(SessionBounds, OnlySuccessiveCountersProveARestart) {
  Line line(0.1);
  const auto verdict = [&line](int counter) {
    line.m.header.counter = static_cast<std::uint16_t>(counter);
    return line.receive().verdict;
  };
  for (const int counter : {1, 2, 4, 5, 4, 5, 7, 9, 11})
    EXPECT_EQ(verdict(counter), Verdict::OutOfOrder) << counter;
  EXPECT_EQ(verdict(12), Verdict::OutOfOrder);
  EXPECT_EQ(verdict(30001), Verdict::Accepted);  // one that fits in between: the proof begins anew
  EXPECT_EQ(verdict(13), Verdict::OutOfOrder);
  EXPECT_EQ(verdict(14), Verdict::OutOfOrder);
  EXPECT_EQ(verdict(15), Verdict::Accepted);
  EXPECT_EQ(line.session.counters().restarts, 1U);
}

TEST(SessionBounds, LenientMeansZerosInTheWholeHeaderAndNothingElse) {
  Line line(0.005, true);
  line.m.header = {};
  const Reception r = line.receive();
  EXPECT_EQ(r.verdict, Verdict::Accepted);
  EXPECT_EQ(r.cycles, 1U);
  EXPECT_TRUE(r.answer_arrived);
  line.m.commanded_position[2] += 0.5F;
  EXPECT_EQ(line.receive().verdict, Verdict::Implausible);
  line.m.commanded_position[2] -= 0.5F;
  line.m.header.id = kMeasurementId;
  EXPECT_EQ(line.receive().verdict, Verdict::WrongSize);
  line.m.header.id = 0;
  line.m.header.size = kMeasurementSize;
  EXPECT_EQ(line.receive().verdict, Verdict::WrongId);
  Line counting(0.005, true);  // one that counts is judged by its counters
  EXPECT_EQ(counting.next(0), Verdict::Duplicate);
  EXPECT_EQ(counting.next(2000), Verdict::OutOfOrder);
  Line half(0.005, true);
  half.m.header.counter = 0;
  half.m.header.reflected = 4;
  EXPECT_EQ(half.receive().verdict, Verdict::OutOfOrder);
}

}  // namespace
}  // namespace lwr_fri_bridge::fri
