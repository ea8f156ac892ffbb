/// The configurator in virtual time: its requests to the KRL program, its time limits and its
/// outcomes.
#include <gtest/gtest.h>

#include <cmath>

#include "lwr_fri_bridge/requests/configurator.hpp"

namespace lwr_fri_bridge {
namespace {

using fri::ControlStrategy;
using fri::FriState;
using fri::KrlConvention;
using fri::Quality;

/// A configurator and its observations: our own program in monitor mode, quality OK, all drives on.
struct Desk {
  explicit Desk(KrlConvention convention = KrlConvention::Coglab)
      : configurator(convention, 4, ConfiguratorLimits()) {
    m.krl.ints[15] = 4010;
    m.state = static_cast<std::uint16_t>(FriState::Monitor);
    m.quality = static_cast<std::uint16_t>(Quality::Ok);
    m.control = static_cast<std::uint16_t>(ControlStrategy::Position);
    m.power = 0x7F;
  }
  Configurator::Observation seen() const { return {connected, &m, now_ns}; }
  void start(ControlStrategy strategy = ControlStrategy::Position) {
    began_ns = now_ns;
    configurator.start(17, strategy, seen());
  }
  void stop() {
    began_ns = now_ns;
    configurator.stop(18, seen());
  }
  /// A step `seconds` after the request; whether it ended.
  bool at(double seconds) {
    now_ns = began_ns + std::llround(1e9 * seconds);
    return configurator.update(seen(), outcome);
  }
  /// As at(), with how it ended.
  OutcomeCode codeAt(double seconds) { return at(seconds) ? outcome.code : OutcomeCode::Pending; }
  void enter(ControlStrategy strategy = ControlStrategy::Position) {
    m.state = static_cast<std::uint16_t>(FriState::Command);
    m.control = static_cast<std::uint16_t>(strategy);
  }
  int asked(int krl_index = 1) const {
    fri::UserData data{};
    configurator.write(data);
    return data.ints[krl_index - 1];
  }
  fri::MeasurementDatagram m{};
  bool connected = true;
  std::int64_t now_ns = 5'000'000'000, began_ns = 0;
  Configurator configurator;
  Outcome outcome;
};

TEST(Configurator, AStartEndsWithCommandModeAndPower) {
  Desk desk;
  EXPECT_FALSE(desk.configurator.busy());
  desk.start(ControlStrategy::JointImpedance);
  EXPECT_TRUE(desk.configurator.busy());
  EXPECT_EQ(desk.asked(), 0);
  EXPECT_EQ(desk.codeAt(0.005), OutcomeCode::Pending);
  EXPECT_EQ(desk.asked(1), 1);
  EXPECT_EQ(desk.asked(2), 30);
  EXPECT_EQ(desk.asked(3), 1);
  desk.enter(ControlStrategy::JointImpedance);
  desk.m.power = 0x3F;
  desk.m.drive_error = 0x05;
  EXPECT_EQ(desk.codeAt(0.5), OutcomeCode::Pending);
  desk.m.power = 0xFF7F;
  EXPECT_EQ(desk.codeAt(1.25), OutcomeCode::Done);
  const Outcome& o = desk.outcome;
  EXPECT_EQ(o.ticket, 17U);
  EXPECT_EQ(o.kind, EventKind::Start);
  EXPECT_EQ(o.wanted, ControlStrategy::JointImpedance);
  EXPECT_EQ(o.reported, ControlStrategy::JointImpedance);
  EXPECT_EQ(o.state, FriState::Command);
  EXPECT_EQ(o.quality, Quality::Ok);
  EXPECT_EQ(o.convention, KrlConvention::Coglab);
  EXPECT_EQ(o.result, fri::KrlResult::None);
  EXPECT_EQ(o.power, 0xFF7F);
  EXPECT_EQ(o.drive_error, 0x05);
  EXPECT_DOUBLE_EQ(o.waited, 1.25);
  EXPECT_FALSE(desk.configurator.busy());
  EXPECT_EQ(desk.asked(1), 0);  // nothing more is asked
  EXPECT_EQ(desk.codeAt(1.3), OutcomeCode::Pending);
}

TEST(Configurator, CommandModeIsRequestedOnlyWithGoodQuality) {
  for (const Quality quality : {Quality::Unacceptable, Quality::Bad}) {
    Desk desk;
    desk.m.quality = static_cast<std::uint16_t>(quality);
    desk.start();
    EXPECT_EQ(desk.codeAt(10.0), OutcomeCode::Pending);
    EXPECT_EQ(desk.asked(), 0);
    EXPECT_EQ(desk.codeAt(10.001), OutcomeCode::PoorQuality);
    EXPECT_EQ(desk.outcome.quality, quality);
    EXPECT_EQ(desk.asked(), 0);
  }
}

TEST(Configurator, AStartIsCancelledAfterItsTimeLimit) {
  Desk desk;
  desk.start();
  desk.at(0.005);
  EXPECT_EQ(desk.codeAt(10.0), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(10.001), OutcomeCode::NotEntered);
  EXPECT_EQ(desk.asked(), 2);  // and taken back at the program
  Desk powerless;
  powerless.m.power = 0x7E;
  powerless.enter();
  powerless.start();
  EXPECT_EQ(powerless.codeAt(10.0), OutcomeCode::Pending);
  EXPECT_EQ(powerless.asked(), 0);  // command mode was there before
  EXPECT_EQ(powerless.codeAt(10.001), OutcomeCode::NoPower);
  EXPECT_EQ(powerless.asked(), 2);
}

TEST(Configurator, AProgramWithoutTheMarkIsLookedForDuringASecond) {
  Desk desk;
  desk.m.krl.ints[15] = 0;
  desk.start();
  EXPECT_EQ(desk.codeAt(0.005), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(1.0), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(1.001), OutcomeCode::NoKrlProgram);
  EXPECT_EQ(desk.asked(), 2);
}

TEST(Configurator, ARefusalOfTheProgramEndsTheStartWithItsReason) {
  Desk desk;
  desk.start();
  desk.at(0.005);
  desk.m.krl.ints[0] = 1;
  desk.m.krl.ints[1] = -4;
  EXPECT_EQ(desk.codeAt(0.01), OutcomeCode::ProgramRefused);
  EXPECT_EQ(desk.outcome.result, fri::KrlResult::NoDrives);
  EXPECT_EQ(desk.asked(), 2);
  EXPECT_EQ(desk.asked(3), 2);  // a request of its own
}

TEST(Configurator, AnotherStrategyALostCommandModeAndSilenceEndAStart) {
  Desk other;
  other.start();
  other.at(0.005);
  other.enter(ControlStrategy::CartesianImpedance);
  EXPECT_EQ(other.codeAt(0.01), OutcomeCode::WrongStrategy);
  EXPECT_EQ(other.asked(), 2);

  Desk left;
  left.m.power = 0;
  left.start();
  left.at(0.005);
  left.enter();
  EXPECT_EQ(left.codeAt(0.01), OutcomeCode::Pending);
  left.m.state = static_cast<std::uint16_t>(FriState::Monitor);
  EXPECT_EQ(left.codeAt(0.015), OutcomeCode::NotEntered);
  EXPECT_EQ(left.asked(), 2);

  Desk silent;
  silent.start();
  silent.at(0.005);
  silent.connected = false;
  EXPECT_EQ(silent.codeAt(0.3), OutcomeCode::LostConnection);
  EXPECT_EQ(silent.asked(), 0);

  Desk fixed(KrlConvention::RcprgTum);
  fixed.start(ControlStrategy::Position);
  EXPECT_EQ(fixed.codeAt(0.0), OutcomeCode::NotSupported);
  EXPECT_EQ(fixed.outcome.convention, KrlConvention::RcprgTum);
}

TEST(Configurator, AStopEndsWithMonitorMode) {
  Desk desk;
  desk.start();
  desk.at(0.005);
  desk.enter();
  ASSERT_EQ(desk.codeAt(0.01), OutcomeCode::Done);
  desk.stop();
  EXPECT_EQ(desk.asked(), 2);
  EXPECT_EQ(desk.asked(3), 2);
  EXPECT_EQ(desk.codeAt(0.005), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(2.0), OutcomeCode::Pending);
  desk.m.state = static_cast<std::uint16_t>(FriState::Monitor);
  EXPECT_EQ(desk.codeAt(2.001), OutcomeCode::Done);
  EXPECT_EQ(desk.outcome.ticket, 18U);
  EXPECT_EQ(desk.outcome.kind, EventKind::Stop);
  EXPECT_EQ(desk.outcome.wanted, ControlStrategy::Position);
  EXPECT_DOUBLE_EQ(desk.outcome.waited, 2.001);
  EXPECT_EQ(desk.asked(), 0);
}

TEST(Configurator, AStopIsGivenUpAfterItsTimeLimits) {
  Desk desk;
  desk.enter();
  desk.stop();
  EXPECT_EQ(desk.codeAt(2.0), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(2.001), OutcomeCode::NotLeft);
  // Silence: the controller's state is unknown, also if the last one was good.
  for (const FriState state : {FriState::Monitor, FriState::Command}) {
    Desk silent;
    silent.m.state = static_cast<std::uint16_t>(state);
    silent.connected = false;
    silent.stop();
    EXPECT_EQ(silent.codeAt(1.0), OutcomeCode::Pending);
    EXPECT_EQ(silent.codeAt(1.001), OutcomeCode::LostConnection);
  }
}

TEST(Configurator, AFallBackWithdrawsTheRequestForCommandMode) {
  Desk desk(KrlConvention::Stanford);
  desk.start();
  desk.at(0.005);
  EXPECT_EQ(desk.asked(16), 10);
  desk.configurator.fellBack();  // not there yet: the request goes on
  EXPECT_EQ(desk.asked(16), 10);
  desk.enter();
  ASSERT_EQ(desk.codeAt(0.01), OutcomeCode::Done);
  EXPECT_EQ(desk.asked(16), 10);
  desk.configurator.fellBack();
  EXPECT_EQ(desk.asked(16), 20);
}

TEST(Configurator, NumbersGrowFromOneWrapAndAreNotThatOfTheLastRequest) {
  Desk desk;
  const auto next = [&desk] {
    desk.stop();
    return desk.asked(3);
  };
  EXPECT_EQ(next(), 1);
  desk.m.krl.ints[0] = 2;  // a program that outlived the last bridge
  EXPECT_EQ(next(), 3);
  for (int number = 4; number <= 32767; ++number) ASSERT_EQ(next(), number);
  EXPECT_EQ(next(), 1);
  // Before the first measurement there is nothing to avoid.
  Configurator blind(KrlConvention::Coglab, 0, ConfiguratorLimits());
  blind.stop(1, {false, nullptr, 0});
  fri::UserData data{};
  blind.write(data);
  EXPECT_EQ(data.ints[2], 1);
}

TEST(Configurator, TheFlagOfAProgramThatOnlyWorksIsWatchedForHalfASecond) {
  Desk desk(KrlConvention::RcprgTum);
  desk.start(ControlStrategy::JointImpedance);
  EXPECT_EQ(desk.codeAt(0.005), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(3.0), OutcomeCode::Pending);  // it has not begun
  desk.m.krl.bools = 1;
  EXPECT_EQ(desk.codeAt(4.0), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(5.0), OutcomeCode::Pending);
  desk.m.krl.bools = 0;
  EXPECT_EQ(desk.codeAt(5.5), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(5.501), OutcomeCode::ProgramRefused);
  desk.start(ControlStrategy::JointImpedance);  // what was seen before does not count for it
  EXPECT_EQ(desk.codeAt(0.005), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(2.0), OutcomeCode::Pending);
}

/// A program with a start request may be about to enter command mode.
TEST(Configurator, AStopAfterAnUnfinishedStartWaitsUntilMonitorModeLasts) {
  Desk desk;
  desk.start();
  desk.at(0.005);
  desk.configurator.abandon(OutcomeCode::Interrupted, desk.seen());
  EXPECT_EQ(desk.codeAt(0.01), OutcomeCode::Interrupted);
  desk.stop();
  EXPECT_EQ(desk.codeAt(0.499), OutcomeCode::Pending);
  desk.enter();
  EXPECT_EQ(desk.codeAt(0.6), OutcomeCode::Pending);
  desk.m.state = static_cast<std::uint16_t>(FriState::Monitor);
  EXPECT_EQ(desk.codeAt(1.09), OutcomeCode::Pending);
  EXPECT_EQ(desk.codeAt(1.1001), OutcomeCode::Done);
}

}  // namespace
}  // namespace lwr_fri_bridge
