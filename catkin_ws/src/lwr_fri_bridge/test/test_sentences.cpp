/// The sentences of events, outcomes and diagnosis: under which condition each is said, and what it
/// names.
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "lwr_fri_bridge/requests/events.hpp"

namespace lwr_fri_bridge {
namespace {

using fri::ControlStrategy;

std::string errorOf(const std::string& event) {
  try {
    parseEvent(event, ControlMode());
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    return what.substr(0, what.find("; known events"));
  }
  return {};
}

TEST(EventSentences, AnErrorNamesWhatIsWrong) {
  const std::vector<std::pair<const char*, const char*>> table = {
      {"", "empty event"},
      {" , = :", "empty event"},
      {"jump", "unknown event 'jump'"},
      {"start now", "'start' takes no parameters, got 'now'"},
      {"hold 1", "'hold' takes no parameters, got '1'"},
      {"position stiffness 300 30", "'position' takes no parameters, got 'stiffness'"},
      {"joint_impedance 100", "'100': expected 'stiffness' or 'damping'"},
      {"joint_impedance stiffness", "stiffness: expected 1 or 7 values, got 0"},
      {"joint_impedance stiffness 1 2", "stiffness: expected 1 or 7 values, got 2"},
      {"joint_impedance stiffness 1 2 3 4 5 6 7 8", "stiffness: expected 1 or 7 values, got 8"},
      {"joint_impedance stiffness 1x", "'1x' in stiffness is not a number"},
      {"joint_impedance damping x", "'x' in damping is not a number"},
      {"joint_impedance stiffness 1 damping", "damping: expected 1 or 7 values, got 0"},
      {"cartesian_impedance stiffness 100",
       "stiffness: expected 2 (translation, rotation) or 6 values, got 1"},
      {"cartesian_impedance stiffness 1 2 3",
       "stiffness: expected 2 (translation, rotation) or 6 values, got 3"},
      {"cartesian_impedance damping .5 .5 .5",
       "damping: expected 1, 2 (translation, rotation) or 6 values, got 3"},
      {"cartesian_impedance damping",
       "damping: expected 1, 2 (translation, rotation) or 6 values, got 0"}};
  for (const auto& [event, error] : table) EXPECT_EQ(errorOf(event), error) << event;
}

/// Both ends of every documented range are in it.
TEST(EventSentences, RangesAreThoseOfTheTable) {
  for (const char* good :
       {"joint_impedance stiffness 0.01", "joint_impedance stiffness 2000",
        "joint_impedance damping 0.1", "joint_impedance damping 1",
        "cartesian_impedance stiffness 0.01 0.01", "cartesian_impedance stiffness 5000 300",
        "cartesian_impedance damping 0.1", "cartesian_impedance damping 1 1"})
    EXPECT_EQ(errorOf(good), "") << good;
  const std::vector<std::pair<const char*, const char*>> table = {
      {"joint_impedance stiffness 0.009", "stiffness 0.009 is outside 0.01..2000"},
      {"joint_impedance stiffness 1 1 1 1 1 1 2001", "stiffness 2001 is outside 0.01..2000"},
      {"joint_impedance damping 0.09", "damping 0.09 is outside 0.1..1"},
      {"joint_impedance damping 1.01", "damping 1.01 is outside 0.1..1"},
      {"joint_impedance stiffness nan", "stiffness nan is outside 0.01..2000"},
      {"cartesian_impedance stiffness 5001 10", "stiffness 5001 is outside 0.01..5000"},
      {"cartesian_impedance stiffness 10 301", "stiffness 301 is outside 0.01..300"},
      {"cartesian_impedance stiffness 1 1 5001 1 1 1", "stiffness 5001 is outside 0.01..5000"},
      {"cartesian_impedance stiffness 1 1 1 301 1 1", "stiffness 301 is outside 0.01..300"},
      {"cartesian_impedance stiffness 10 0.009", "stiffness 0.009 is outside 0.01..300"},
      {"cartesian_impedance damping 1 1.1", "damping 1.1 is outside 0.1..1"},
      {"cartesian_impedance damping 0.09", "damping 0.09 is outside 0.1..1"}};
  for (const auto& [event, error] : table) EXPECT_EQ(errorOf(event), error) << event;
}

TEST(EventSentences, ValuesGoWhereTheyBelongAndWhatIsLeftOutIsKept) {
  const ControlMode joint =
      parseEvent("joint_impedance stiffness 40 damping .1 .2 .3 .4 .5 .6 .7", ControlMode()).mode;
  EXPECT_EQ(joint.joint_stiffness, Vector7::Constant(40.0));
  for (int i = 0; i < 7; ++i) EXPECT_DOUBLE_EQ(joint.joint_damping[i], 0.1 * (i + 1));
  const ControlMode frame = parseEvent("cartesian_impedance damping:0.3", joint).mode;
  EXPECT_EQ(frame.cartesian_damping, Vector6::Constant(0.3));
  EXPECT_EQ(frame.cartesian_stiffness, ControlMode().cartesian_stiffness);
  EXPECT_EQ(frame.joint_stiffness, joint.joint_stiffness);
  const ControlMode two = parseEvent("cartesian_impedance stiffness 100,10", frame).mode;
  EXPECT_EQ(two.cartesian_stiffness, (Vector6() << 100, 100, 100, 10, 10, 10).finished());
  EXPECT_EQ(two.cartesian_damping, frame.cartesian_damping);
  const ControlMode six = parseEvent("cartesian_impedance stiffness 1 2 3 4 5 6", two).mode;
  EXPECT_EQ(six.cartesian_stiffness, (Vector6() << 1, 2, 3, 4, 5, 6).finished());
  for (const char* event : {"start", "hold", "reset", "stop"})
    EXPECT_EQ(parseEvent(event, six).mode.strategy, ControlStrategy::CartesianImpedance) << event;
  EXPECT_EQ(parseEvent("position", six).kind, EventKind::Mode);
  EXPECT_EQ(parseEvent("joint_impedance", six).kind, EventKind::Mode);
}

/// An outcome in which every field has a value of its own.
Outcome outcomeOf(EventKind kind, OutcomeCode code) {
  Outcome o;
  o.kind = kind;
  o.code = code;
  o.wanted = ControlStrategy::JointImpedance;
  o.reported = ControlStrategy::CartesianImpedance;
  o.state = fri::FriState::Monitor;
  o.quality = fri::Quality::Bad;
  o.convention = fri::KrlConvention::Stanford;
  o.power = 0x3D;
  o.waited = 1.26;
  return o;
}

TEST(OutcomeSentences, TellWhatWasAskedWhatCameAndWhatToDo) {
  using Code = OutcomeCode;
  using Kind = EventKind;
  const std::vector<std::tuple<Kind, Code, const char*>> table = {
      {Kind::Start, Code::Pending, "start: not finished yet"},
      {Kind::Mode, Code::Done, "next start uses JNT_IMP"},
      {Kind::Start, Code::Done, "command mode with CART_IMP after 1.3 s"},
      {Kind::Stop, Code::Done, "stop: done"},
      {Kind::Hold, Code::Done, "hold: done"},
      {Kind::Reset, Code::AlreadyThere, "reset: nothing to do, it is so already"},
      {Kind::Start, Code::Disconnected, "start: no datagrams from the robot controller; "},
      {Kind::Start, Code::Held, "start refused: hold is latched; send reset first"},
      {Kind::Mode, Code::InCommandMode, "control mode refused: strategy and flags may change in "},
      {Kind::Start, Code::NotSupported,
       "start refused: the KRL program of krl_convention stanford cannot run JNT_IMP"},
      {Kind::Start, Code::Interrupted, "start: interrupted by hold, stop or a fall-back"},
      {Kind::Stop, Code::Busy, "stop refused: a start or stop is in progress; "},
      {Kind::Stop, Code::LostConnection, "stop: the robot controller fell silent after 1.3 s"},
      {Kind::Stop, Code::NotServed, "stop: the FRI thread did not take the request within 1.3 s"},
      {Kind::Start, Code::PoorQuality,
       "start: quality of the connection is BAD after 1.3 s, OK or PERFECT is needed; "},
      {Kind::Start, Code::NoKrlProgram,
       "start: the controller shows no sign of the KRL program of krl_convention stanford; "},
      {Kind::Start, Code::ProgramRefused,
       "start: the KRL program refused after 1.3 s: no reason given"},
      {Kind::Start, Code::NotEntered,
       "start: still in MON after 1.3 s, CMD expected; quality BAD; read the messages on the "
       "pendant, and check that krl_convention (stanford) is that of the running program"},
      {Kind::Start, Code::NoPower,
       "start: command mode, but drive power is 0x3D instead of 0x7F after 1.3 s; "},
      {Kind::Start, Code::WrongStrategy,
       "start: the controller is in CART_IMP instead of JNT_IMP; monitor mode was requested"},
      {Kind::Stop, Code::NotLeft, "stop: still in MON after 1.3 s, MON expected; "}};
  for (const auto& [kind, code, sentence] : table)
    EXPECT_EQ(describe(outcomeOf(kind, code)).substr(0, std::string(sentence).size()), sentence);
  Outcome broken = outcomeOf(Kind::Start, Code::NotEntered);
  broken.drive_error = 1;
  EXPECT_NE(describe(broken).find("quality BAD, drive errors; read"), std::string::npos);
}

TEST(OutcomeSentences, TheReasonsOfOurProgramHaveWords) {
  const std::vector<std::pair<fri::KrlResult, const char*>> table = {
      {fri::KrlResult::None, "no reason given"},
      {fri::KrlResult::Done, "done"},
      {fri::KrlResult::UnknownRequest, "it does not know the request or the strategy"},
      {fri::KrlResult::PoorQuality, "the quality of the connection did not become good"},
      {fri::KrlResult::NotEntered, "friStart did not lead to command mode"},
      {fri::KrlResult::NoDrives, "drives or brakes could not be switched on"},
      {static_cast<fri::KrlResult>(-9), "unknown reason"}};
  for (const auto& [result, words] : table) {
    Outcome o = outcomeOf(EventKind::Start, OutcomeCode::ProgramRefused);
    o.result = result;
    EXPECT_NE(describe(o).find(std::string("after 1.3 s: ") + words), std::string::npos) << words;
  }
}

TEST(OutcomeSentences, DoneAndAlreadyThereAreSuccesses) {
  for (int code = 0; code <= static_cast<int>(OutcomeCode::NotServed); ++code) {
    const Outcome o = outcomeOf(EventKind::Stop, static_cast<OutcomeCode>(code));
    EXPECT_EQ(o.success(), o.code == OutcomeCode::Done || o.code == OutcomeCode::AlreadyThere);
  }
}

/// Connected, in monitor mode, 5 ms cycles, quality PERFECT.
Snapshot connected() {
  Snapshot s;
  s.supervisor = SupervisorState::Monitor;
  s.quality = fri::Quality::Perfect;
  s.sample.cycle_time = 0.005;
  s.sample.block = MotionBlock::None;
  s.latency = 0.0012F;
  return s;
}

TEST(Diagnosis, SilenceIsAnErrorWithAHintAtWhatComes) {
  Snapshot s;
  Diagnosis d = diagnoseConnection(s, {}, 49938, 12.0);
  EXPECT_EQ(d.severity, Severity::Error);
  EXPECT_NE(d.text.find("for 12 s; check cable, FRIHOST"), std::string::npos) << d.text;
  s.session.wrong_id = 1;
  d = diagnoseConnection(s, {}, 49938, 12.0);
  EXPECT_NE(d.text.find("for 12 s; what comes is rejected"), std::string::npos) << d.text;
  EXPECT_EQ(diagnoseArm(s, 70.0).severity, Severity::Warning);
  EXPECT_EQ(diagnoseArm(s, 70.0).text, "not connected");
}

TEST(Diagnosis, PoorQualityIsExplainedByWhatIsSeen) {
  const auto text = [](float miss_rate, float latency, std::uint64_t measurements,
                       std::uint64_t answers, bool real_time = false) {
    Snapshot s = connected();
    s.quality = fri::Quality::Bad;
    s.miss_rate = miss_rate;
    s.latency = latency;
    s.session.lost_measurements = measurements;
    s.session.lost_answers = answers;
    FriThreadStatistics thread;
    thread.real_time = real_time;
    return diagnoseConnection(s, thread, 1, 0.0).text;
  };
  EXPECT_EQ(text(0.06F, 0.0026F, 0, 0),
            "quality BAD: answers take 2.60 ms of a 5 ms cycle; the FRI thread has no real-time "
            "priority, give the binary cap_sys_nice");
  EXPECT_EQ(text(0.06F, 0.0026F, 0, 0, true)
                .find("quality BAD: answers take 2.60 ms of a 5 ms "
                      "cycle; use a direct cable, a real computer"),
            0U);
  const std::string lost =
      "quality BAD: packets are lost on the way; use a direct cable and a "
      "network card of its own, no switch and no Wi-Fi";
  const std::string waits =
      "quality BAD: it needs 100 answered packets to judge; if it stays, look "
      "at the load of this computer";
  EXPECT_EQ(text(0.04F, 0.0026F, 0, 0), waits);  // few misses
  EXPECT_EQ(text(0.06F, 0.0024F, 0, 0), waits);  // quick answers
  EXPECT_EQ(text(0.0F, 0.0F, 1, 0), lost);
  EXPECT_EQ(text(0.0F, 0.0F, 0, 1), lost);
  EXPECT_EQ(text(0.0F, 0.0F, 3, 3), lost);
  Snapshot s = connected();
  for (const auto& [quality, severity] : {std::pair{fri::Quality::Unacceptable, Severity::Error},
                                          std::pair{fri::Quality::Bad, Severity::Warning},
                                          std::pair{fri::Quality::Ok, Severity::Ok}}) {
    s.quality = quality;
    EXPECT_EQ(diagnoseConnection(s, {}, 1, 0.0).severity, severity);
  }
}

TEST(Diagnosis, AGoodConnectionTellsPeerLatencyAndCycle) {
  FriThreadStatistics thread;
  thread.peer = "10.0.0.2:49938";
  const Snapshot s = connected();
  EXPECT_EQ(diagnoseConnection(s, thread, 1, 0.0).text,
            "quality PERFECT from 10.0.0.2:49938, latency 1.20 ms, cycle 5 ms");
  thread.last_foreign = "10.0.0.9:7";
  const Diagnosis d = diagnoseConnection(s, thread, 1, 0.0);
  EXPECT_EQ(d.severity, Severity::Warning);
  EXPECT_NE(d.text.find("(10.0.0.9:7) uses the port and is ignored; the peer is 10.0.0.2:49938"),
            std::string::npos)
      << d.text;
}

TEST(Diagnosis, JointsWithErrorsHeatAndWarningsAreNamed) {
  const char* names[7] = {"lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"};
  for (int joint = 0; joint < 7; ++joint) {
    Snapshot s = connected();
    s.drive_warning = static_cast<std::uint16_t>(1U << joint);
    EXPECT_EQ(diagnoseArm(s, 70.0).text, std::string("drive warning: ") + names[joint]);
    EXPECT_EQ(diagnoseArm(s, 70.0).severity, Severity::Warning);
    EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::DriveWarning);
    s.temperature.fill(70.0F);
    s.temperature[static_cast<std::size_t>(joint)] = 70.5F;  // comes before a warning
    EXPECT_EQ(diagnoseArm(s, 70.0).text, std::string("drives are hot: ") + names[joint]);
    EXPECT_EQ(diagnoseArm(s, 70.0).severity, Severity::Warning);
    s.drive_error = s.drive_warning;
    EXPECT_EQ(diagnoseArm(s, 70.0).text, std::string("drive error: ") + names[joint]);
    EXPECT_EQ(diagnoseArm(s, 70.0).severity, Severity::Error);
  }
  Snapshot s = connected();
  s.drive_error = 0x7F;
  EXPECT_EQ(diagnoseArm(s, 70.0).text,
            "drive error: lwr_a1, lwr_a2, lwr_e1, lwr_a3, lwr_a4, lwr_a5, lwr_a6");
  s = connected();
  s.drive_error = s.drive_warning = 0xFF80;  // of no drive
  EXPECT_EQ(diagnoseArm(s, 70.0).text, "motion is allowed");
  EXPECT_EQ(diagnoseArm(s, 70.0).severity, Severity::Ok);
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::None);
}

/// How command mode was lost is told where a start leads on, and in silence; the joint for a leash.
TEST(Diagnosis, AReasonNamesTheJointAndTheLossWhereTheyMatter) {
  CommandModeLoss loss;
  loss.cause = LossCause::PacketsLost;
  EXPECT_EQ(reasonOf(MotionBlock::None, -1), "");
  for (int i = 1; i <= static_cast<int>(MotionBlock::DriveError); ++i) {
    const auto block = static_cast<MotionBlock>(i);
    const std::string plain = describe(block);
    EXPECT_EQ(reasonOf(block, -1), plain);
    const bool leads_on = block == MotionBlock::Disconnected || block == MotionBlock::Monitor ||
                          block == MotionBlock::NoPower || block == MotionBlock::NotStarted;
    EXPECT_EQ(reasonOf(block, -1, loss), leads_on ? describe(loss) + "; now: " + plain : plain);
    EXPECT_EQ(reasonOf(block, 0), block == MotionBlock::Leashed ? "lwr_a1: " + plain : plain);
    EXPECT_EQ(reasonOf(block, 6), block == MotionBlock::Leashed ? "lwr_a6: " + plain : plain);
  }
}

TEST(Diagnosis, TheCodeOfALossOfThisComputerReplacesThatOfMonitorModeOnly) {
  CommandModeLoss loss;
  EXPECT_EQ(codeOf(MotionBlock::Monitor, loss), ReasonCode::NotInCommandMode);
  EXPECT_EQ(codeOf(MotionBlock::NotStarted, loss), ReasonCode::NotStarted);
  loss.cause = LossCause::ControllerStalled;
  for (int i = 0; i <= static_cast<int>(MotionBlock::DriveError); ++i) {
    const auto block = static_cast<MotionBlock>(i);
    const bool lost = block == MotionBlock::Monitor || block == MotionBlock::NotStarted;
    EXPECT_EQ(codeOf(block, loss), lost ? ReasonCode::ComputerLate : codeOf(block)) << i;
  }
}

}  // namespace
}  // namespace lwr_fri_bridge
