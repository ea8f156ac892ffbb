/// Events of ros_events and command, outcomes in words, KRL conventions, and what the diagnosis
/// says.
#include <gtest/gtest.h>

#include <stdexcept>

#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

using fri::ControlStrategy;
using fri::KrlConvention;
using fri::KrlPhase;

std::string errorOf(const std::string& event) {
  try {
    parseEvent(event, ControlMode());
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(Events, KnownOnesAreRead) {
  const ControlMode current;
  EXPECT_EQ(parseEvent("start", current).kind, EventKind::Start);
  EXPECT_EQ(parseEvent(" hold ", current).kind, EventKind::Hold);
  EXPECT_EQ(parseEvent("reset", current).kind, EventKind::Reset);
  EXPECT_EQ(parseEvent("stop", current).kind, EventKind::Stop);
  EXPECT_EQ(parseEvent("position", current).mode.strategy, ControlStrategy::Position);
  const ControlMode joint =
      parseEvent("joint_impedance damping 0.3 stiffness 1,2,3,4,5,6,7", current).mode;
  EXPECT_EQ(joint.strategy, ControlStrategy::JointImpedance);
  EXPECT_DOUBLE_EQ(joint.joint_stiffness[6], 7.0);
  EXPECT_DOUBLE_EQ(joint.joint_damping[2], 0.3);
  const ControlMode frame =
      parseEvent("cartesian_impedance stiffness=1500 150 damping=0.8 0.9", joint).mode;
  EXPECT_EQ(frame.strategy, ControlStrategy::CartesianImpedance);
  EXPECT_DOUBLE_EQ(frame.cartesian_stiffness[2], 1500.0);
  EXPECT_DOUBLE_EQ(frame.cartesian_stiffness[3], 150.0);
  EXPECT_DOUBLE_EQ(frame.cartesian_damping[5], 0.9);
  EXPECT_DOUBLE_EQ(frame.joint_stiffness[6], 7.0);  // kept
}

TEST(Events, UnknownOnesAreRejectedWithTheList) {
  for (const char* event :
       {"", "jump", "start now", "joint_impedance 100", "joint_impedance stiffness",
        "joint_impedance stiffness 1 2", "joint_impedance stiffness 1x", "position stiffness 3",
        "joint_impedance stiffness 2001", "joint_impedance damping 0",
        "joint_impedance damping nan", "cartesian_impedance stiffness 5001 10",
        "cartesian_impedance stiffness 100"}) {
    const std::string error = errorOf(event);
    EXPECT_NE(error.find("known events: start, hold, reset, stop, position"), std::string::npos)
        << event << ": " << error;
  }
  EXPECT_NE(errorOf("jump").find("'jump'"), std::string::npos);
  EXPECT_NE(errorOf("joint_impedance stiffness 2001").find("0.01..2000"), std::string::npos);
}

TEST(Events, EveryOutcomeHasWords) {
  for (int code = 0; code <= static_cast<int>(OutcomeCode::NotServed); ++code) {
    Outcome outcome;
    outcome.kind = EventKind::Start;
    outcome.code = static_cast<OutcomeCode>(code);
    EXPECT_GT(describe(outcome).size(), 8U) << code;
  }
}

TEST(Krl, ConventionsWriteTheTable) {
  struct Row {
    KrlConvention convention;
    KrlPhase phase;
    std::vector<std::pair<int, int>> ints;  // 1-based
    int bools;
  };
  const std::vector<Row> table = {
      {KrlConvention::Coglab, KrlPhase::Start, {{1, 1}, {2, 30}, {3, 9}}, 0},
      {KrlConvention::Coglab, KrlPhase::Stop, {{1, 2}, {3, 9}}, 0},
      {KrlConvention::Coglab, KrlPhase::Running, {{1, 0}}, 0},
      {KrlConvention::CentroEpiaggio, KrlPhase::Start, {{2, 1}, {1, 30}}, 0},
      {KrlConvention::CentroEpiaggio, KrlPhase::Running, {{2, 1}}, 0},
      {KrlConvention::CentroEpiaggio, KrlPhase::Stop, {{2, 0}}, 0},
      {KrlConvention::CentroEpiaggio, KrlPhase::Idle, {{2, 0}}, 0},
      {KrlConvention::Stanford, KrlPhase::Start, {{16, 10}, {15, 30}}, 0},
      {KrlConvention::Stanford, KrlPhase::Stop, {{16, 20}}, 0},
      {KrlConvention::Stanford, KrlPhase::Idle, {{16, 20}}, 0},
      {KrlConvention::RcprgTum, KrlPhase::Start, {{1, 1}}, 0x01},
      {KrlConvention::RcprgTum, KrlPhase::Running, {{1, 0}}, 0x80},
      {KrlConvention::RcprgTum, KrlPhase::Stop, {{1, 2}}, 0x01},
      {KrlConvention::RttLwr, KrlPhase::Start, {{1, 1}, {2, 30}, {3, 4}}, 0},
      {KrlConvention::RttLwr, KrlPhase::Stop, {{1, 2}}, 0},
      {KrlConvention::RttLwr, KrlPhase::Running, {{1, 0}}, 0},
  };
  for (const Row& row : table) {
    fri::UserData data{};
    writeRequest(row.convention, {row.phase, ControlStrategy::JointImpedance, 9, 4}, data);
    for (const auto& [index, value] : row.ints) {
      EXPECT_EQ(data.ints[index - 1], value) << nameOf(row.convention) << " INT[" << index << "]";
    }
    EXPECT_EQ(data.bools, row.bools) << nameOf(row.convention);
  }
}

TEST(Krl, NamesAndStrategies) {
  for (const char* name : {"coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr"}) {
    EXPECT_STREQ(nameOf(fri::krlConventionFromName(name)), name);
  }
  EXPECT_THROW(fri::krlConventionFromName("orocos"), std::invalid_argument);
  EXPECT_FALSE(supports(KrlConvention::RcprgTum, ControlStrategy::Position));
  EXPECT_TRUE(supports(KrlConvention::RcprgTum, ControlStrategy::JointImpedance));
  EXPECT_TRUE(supports(KrlConvention::Stanford, ControlStrategy::CartesianImpedance));
}

TEST(Krl, OurProgramsResultsAreRead) {
  fri::UserData data{};
  const fri::KrlRequest request{KrlPhase::Start, ControlStrategy::Position, 5, 0};
  EXPECT_FALSE(readReply(KrlConvention::Coglab, request, data).known);
  data.ints[15] = 4010;
  data.ints[2] = 5;
  EXPECT_TRUE(readReply(KrlConvention::Coglab, request, data).busy);
  data.ints[0] = 5;
  data.ints[1] = -4;
  const fri::KrlReply reply = readReply(KrlConvention::Coglab, request, data);
  EXPECT_TRUE(reply.refused);
  EXPECT_EQ(reply.result, fri::KrlResult::NoDrives);
  data.ints[0] = 4;  // result of an older request
  EXPECT_FALSE(readReply(KrlConvention::Coglab, request, data).refused);
}

TEST(Krl, TheBusyFlagOfEachConventionIsRead) {
  const fri::KrlRequest request{KrlPhase::Start, ControlStrategy::JointImpedance, 5, 0};
  fri::UserData data{};
  for (int bit = 0; bit < 16; ++bit) {
    data.bools = static_cast<std::uint16_t>(1U << bit);
    EXPECT_EQ(readReply(KrlConvention::RcprgTum, request, data).busy, bit == 0) << bit;
    EXPECT_FALSE(readReply(KrlConvention::Coglab, request, data).busy);
    EXPECT_FALSE(readReply(KrlConvention::RttLwr, request, data).busy);
  }
  data = {};
  data.ints[2] = 4;  // it works on an older request of ours
  EXPECT_FALSE(readReply(KrlConvention::Coglab, request, data).busy);
  data.ints[2] = 5;
  EXPECT_TRUE(readReply(KrlConvention::Coglab, request, data).busy);
}

/// The program of rcprg_tum shows nothing but that it works: done, and still in monitor mode, it
/// has refused.
TEST(Krl, AProgramThatWasBusyAndLeavesMonitorModeInForceHasRefused) {
  struct Case {
    int busy_from, busy_until;  // cycles of 5 ms after the request
    OutcomeCode code;
    double least, most;  // s until the outcome
  };
  const double late = BridgeConfig().requests.start_timeout;
  for (const Case& one : {Case{20, 60, OutcomeCode::ProgramRefused, 0.75, 0.85},
                          Case{20, 1000000, OutcomeCode::NotEntered, late, late + 0.1},
                          Case{0, 0, OutcomeCode::NotEntered, late, late + 0.1}}) {
    BridgeConfig config = test::defaultConfig();
    config.krl_convention = KrlConvention::RcprgTum;
    config.mode.strategy = ControlStrategy::JointImpedance;
    Bridge bridge(config);
    test::SmallController robot(0.005);
    robot.obeys = false;
    std::uint32_t ticket = 0;
    Outcome outcome;
    int cycle = -10;
    for (; cycle < 4000 && outcome.code == OutcomeCode::Pending; ++cycle) {
      if (cycle == 0) ticket = bridge.submit("start");
      fri::MeasurementDatagram m = robot.measure();
      m.krl = {};
      m.krl.bools = cycle >= one.busy_from && cycle < one.busy_until ? 1 : 0;
      std::uint8_t bytes[fri::kMeasurementSize];
      fri::encode(m, bytes);
      fri::CommandDatagram answer;
      ASSERT_TRUE(bridge.answer(bytes, sizeof bytes, robot.now(), answer));
      robot.take(&answer);
      if (cycle >= 0) outcome = bridge.outcome(ticket);
    }
    EXPECT_EQ(outcome.code, one.code) << describe(outcome);
    EXPECT_GE(cycle * 0.005, one.least);
    EXPECT_LE(cycle * 0.005, one.most);
  }
}

TEST(Krl, AStartWithoutOurProgramSaysSo) {
  BridgeConfig config = test::defaultConfig();
  Bridge bridge(config);
  test::SmallController robot(0.005);
  robot.obeys = false;
  const std::uint32_t ticket = bridge.submit("start");
  Outcome outcome;
  for (int i = 0; i < 1000 && outcome.code == OutcomeCode::Pending; ++i) {
    fri::MeasurementDatagram m = robot.measure();
    m.krl = {};
    std::uint8_t bytes[fri::kMeasurementSize];
    fri::encode(m, bytes);
    fri::CommandDatagram answer;
    if (i == 0) bridge.idle(robot.now());
    bridge.answer(bytes, sizeof bytes, robot.now(), answer);
    robot.take(&answer);
    outcome = bridge.outcome(ticket);
    if (i == 0) break;
  }
  EXPECT_EQ(outcome.code, OutcomeCode::Disconnected);

  const std::uint32_t again = bridge.submit("start");
  for (int i = 0; i < 1000 && (outcome = bridge.outcome(again)).code == OutcomeCode::Pending; ++i) {
    fri::MeasurementDatagram m = robot.measure();
    m.krl = {};
    std::uint8_t bytes[fri::kMeasurementSize];
    fri::encode(m, bytes);
    fri::CommandDatagram answer;
    bridge.answer(bytes, sizeof bytes, robot.now(), answer);
    robot.take(&answer);
  }
  EXPECT_EQ(outcome.code, OutcomeCode::NoKrlProgram);
  EXPECT_NE(describe(outcome).find("krl_convention"), std::string::npos);
}

TEST(Diagnosis, GivesAHintWhenQualityIsPoor) {
  Snapshot s;
  FriThreadStatistics thread;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 12.0)
                .text.find("no valid packet received on port 49938 for 12 s"),
            std::string::npos);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 12.0).code, ReasonCode::RobotDisconnected);
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::RobotDisconnected);
  s.supervisor = SupervisorState::Monitor;
  s.sample.cycle_time = 0.001;
  s.quality = fri::Quality::Bad;
  s.miss_rate = 0.2F;
  s.latency = 0.0009F;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("real-time priority"),
            std::string::npos);
  thread.real_time = true;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("virtual machine"),
            std::string::npos);
  s.miss_rate = 0.0F;
  s.session.lost_measurements = 10;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("cable"), std::string::npos);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::PoorQuality);
  s.quality = fri::Quality::Perfect;
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).severity, Severity::Ok);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::None);
  thread.last_foreign = "127.0.0.1:9";
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("127.0.0.1:9"), std::string::npos);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::SecondSender);
  s.sample.block = MotionBlock::Held;
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::Held);
  s.temperature[2] = 80.0F;
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::DriveWarning);
  s.drive_error = 0x10;
  EXPECT_NE(diagnoseArm(s, 70.0).text.find("lwr_a4"), std::string::npos);
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::DriveError);
}

TEST(Events, AFullQueueIsCountedAndSaid) {
  Bridge bridge(test::defaultConfig());
  std::uint32_t last = 0;
  for (int i = 0; i < 20; ++i) last = bridge.submit("hold");  // nobody serves them
  EXPECT_EQ(bridge.snapshot().counters.requests_dropped, 4U);
  EXPECT_EQ(bridge.outcome(last).code, OutcomeCode::NotServed);
}

}  // namespace
}  // namespace lwr_fri_bridge
