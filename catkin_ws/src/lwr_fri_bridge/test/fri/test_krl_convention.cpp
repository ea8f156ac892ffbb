/// Fields that each KRL convention writes and reads, in every phase and for every strategy.
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "lwr_fri_bridge/fri/krl_convention.hpp"

namespace lwr_fri_bridge::fri {
namespace {

constexpr int kNumber = 9, kTool = 4,
              kStrategy = -10;  // the last stands for ten times the strategy
constexpr KrlConvention kAll[] = {KrlConvention::Coglab,   KrlConvention::CentroEpiaggio,
                                  KrlConvention::Stanford, KrlConvention::RcprgTum,
                                  KrlConvention::RttLwr,   KrlConvention::OpenKc};

struct Row {
  KrlConvention convention;
  KrlPhase phase;
  std::vector<std::pair<int, int>> ints;  // index as KRL counts, value
  unsigned written = 0, bools = 0;        // bits that belong to the convention, and their values
};

const std::vector<Row>& table() {
  using C = KrlConvention;
  using P = KrlPhase;
  static const std::vector<Row> rows = {
      {C::Coglab, P::Idle, {{1, 0}, {2, kStrategy}, {3, kNumber}}},
      {C::Coglab, P::Start, {{1, 1}, {2, kStrategy}, {3, kNumber}}},
      {C::Coglab, P::Running, {{1, 0}, {2, kStrategy}, {3, kNumber}}},
      {C::Coglab, P::Stop, {{1, 2}, {2, kStrategy}, {3, kNumber}}},
      {C::CentroEpiaggio, P::Idle, {{1, kStrategy}, {2, 0}}},
      {C::CentroEpiaggio, P::Start, {{1, kStrategy}, {2, 1}}},
      {C::CentroEpiaggio, P::Running, {{1, kStrategy}, {2, 1}}},
      {C::CentroEpiaggio, P::Stop, {{1, kStrategy}, {2, 0}}},
      {C::Stanford, P::Idle, {{15, kStrategy}, {16, 20}}},
      {C::Stanford, P::Start, {{15, kStrategy}, {16, 10}}},
      {C::Stanford, P::Running, {{15, kStrategy}, {16, 10}}},
      {C::Stanford, P::Stop, {{15, kStrategy}, {16, 20}}},
      {C::RcprgTum, P::Idle, {{1, 0}}, 0x81, 0x00},
      {C::RcprgTum, P::Start, {{1, 1}}, 0x81, 0x01},
      {C::RcprgTum, P::Running, {{1, 0}}, 0x81, 0x80},
      {C::RcprgTum, P::Stop, {{1, 2}}, 0x81, 0x01},
      {C::RttLwr, P::Idle, {{1, 0}, {2, kStrategy}, {3, kTool}}},
      {C::RttLwr, P::Start, {{1, 1}, {2, kStrategy}, {3, kTool}}},
      {C::RttLwr, P::Running, {{1, 0}, {2, kStrategy}, {3, kTool}}},
      {C::RttLwr, P::Stop, {{1, 2}, {2, kStrategy}, {3, kTool}}},
      {C::OpenKc, P::Start, {{16, 0}}, 0x01, 0x00},
      {C::OpenKc, P::Running, {{16, 0}}, 0x01, 0x00},
  };
  return rows;
}

TEST(KrlConvention, WritesItsOwnFieldsAndLeavesTheOthersAlone) {
  for (const Row& row : table()) {
    for (const int strategy : {1, 2, 3}) {
      for (const unsigned before : {0x0000U, 0xFFFFU}) {
        UserData data{};
        for (int i = 0; i < 16; ++i) data.ints[i] = 7000 + i;
        data.bools = static_cast<std::uint16_t>(before);
        KrlRequest request;
        request.phase = row.phase;
        request.strategy = static_cast<ControlStrategy>(strategy);
        request.number = kNumber;
        request.tool = kTool;
        std::vector<int> expected(data.ints, data.ints + 16);
        for (const auto& [index, value] : row.ints)
          expected[static_cast<std::size_t>(index - 1)] =
              value == kStrategy ? 10 * strategy : value;
        writeRequest(row.convention, request, data);
        EXPECT_EQ(std::vector<int>(data.ints, data.ints + 16), expected)
            << nameOf(row.convention) << " phase " << static_cast<int>(row.phase);
        EXPECT_EQ(data.bools, (before & ~row.written) | row.bools) << nameOf(row.convention);
      }
    }
  }
}

/// The PC's side of openkc with a program that shows `shown` in TO_INT[15] and TO_BOOL[1].
struct OpenKc {
  std::pair<int, int> step(int shown, bool answers) {
    UserData from{}, to{};
    from.ints[14] = shown;
    from.bools = answers ? 1 : 0;
    stepRequest(KrlConvention::OpenKc, request, from);
    writeRequest(KrlConvention::OpenKc, request, to);
    return {to.ints[15], to.bools};
  }
  KrlRequest request;
};

TEST(OpenKc, AStartIsTheStrategysCommandAndThenFriStart) {
  using Shown = std::pair<int, int>;
  for (const auto& [strategy, command] :
       {std::pair{ControlStrategy::Position, 9}, std::pair{ControlStrategy::CartesianImpedance, 6},
        std::pair{ControlStrategy::JointImpedance, 7}}) {
    OpenKc pc;
    pc.request.phase = KrlPhase::Start;
    pc.request.strategy = strategy;
    EXPECT_EQ(pc.step(0, true), Shown(0, 0));  // an answer to something older: wait
    EXPECT_EQ(pc.step(0, false), Shown(command, 1));
    EXPECT_EQ(pc.step(0, false), Shown(command, 1));
    EXPECT_EQ(pc.step(2, true), Shown(command, 1));         // another command is over
    EXPECT_EQ(pc.step(command, false), Shown(command, 1));  // shown, and not over
    EXPECT_EQ(pc.step(command, true), Shown(0, 0));         // over: BOOL[1] is taken back
    EXPECT_EQ(pc.step(command, true), Shown(0, 0));         // until the program does so too
    EXPECT_EQ(pc.step(command, false), Shown(1, 1));
    EXPECT_EQ(pc.step(1, true), Shown(0, 0));
    EXPECT_EQ(pc.step(1, false), Shown(0, 0));  // nothing is left to ask for
    EXPECT_EQ(pc.request.acknowledged, 2);
  }
}

TEST(OpenKc, AStopIsFriStopAndOtherPhasesRequestNothing) {
  using Shown = std::pair<int, int>;
  OpenKc pc;
  pc.request.phase = KrlPhase::Stop;
  EXPECT_EQ(pc.step(0, false), Shown(2, 1));
  EXPECT_EQ(pc.step(2, true), Shown(0, 0));
  EXPECT_EQ(pc.step(2, false), Shown(0, 0));
  EXPECT_EQ(pc.request.acknowledged, 1);
  for (const KrlPhase phase : {KrlPhase::Idle, KrlPhase::Running}) {
    OpenKc idle;
    idle.request.phase = phase;
    idle.request.asserted = true;  // left over
    EXPECT_EQ(idle.step(0, true), Shown(0, 0));
    EXPECT_EQ(idle.request.acknowledged, 0);
    EXPECT_EQ(idle.step(0, false), Shown(0, 0));
  }
}

/// TO_INT[2] of our own program counts for the request of the moment only, and is bad below zero.
TEST(KrlConvention, OurProgramsResultsAreThoseOfTheTable) {
  const std::vector<std::pair<int, KrlResult>> results = {
      {0, KrlResult::None},         {1, KrlResult::Done},        {-1, KrlResult::UnknownRequest},
      {-2, KrlResult::PoorQuality}, {-3, KrlResult::NotEntered}, {-4, KrlResult::NoDrives}};
  for (const auto& [number, result] : results) {
    UserData from{};
    from.ints[15] = 4010;
    from.ints[0] = kNumber;
    from.ints[1] = number;
    KrlRequest request;
    request.number = kNumber;
    for (const KrlPhase phase : {KrlPhase::Start, KrlPhase::Stop}) {
      request.phase = phase;
      const KrlReply reply = readReply(KrlConvention::Coglab, request, from);
      EXPECT_TRUE(reply.known);
      EXPECT_FALSE(reply.busy);
      EXPECT_EQ(reply.result, result) << number;
      EXPECT_EQ(reply.refused, number < 0) << number;
    }
    for (const KrlPhase phase : {KrlPhase::Idle, KrlPhase::Running}) {
      request.phase = phase;  // nothing is asked, so nothing is refused
      EXPECT_EQ(readReply(KrlConvention::Coglab, request, from).result, KrlResult::None);
      EXPECT_FALSE(readReply(KrlConvention::Coglab, request, from).refused);
    }
  }
}

TEST(KrlConvention, ProgramsWithoutAMarkAreKnownAndRefuseNothing) {
  UserData from{};
  for (int i = 0; i < 16; ++i) from.ints[i] = -1;
  KrlRequest request;
  request.phase = KrlPhase::Start;
  for (const KrlConvention convention : kAll) {
    const KrlReply reply = readReply(convention, request, from);
    EXPECT_EQ(reply.known, convention != KrlConvention::Coglab) << nameOf(convention);
    EXPECT_FALSE(reply.busy) << nameOf(convention);
    EXPECT_FALSE(reply.refused) << nameOf(convention);
    EXPECT_EQ(reply.result, KrlResult::None) << nameOf(convention);
  }
}

TEST(KrlConvention, AllButOneRunEveryStrategy) {
  for (const KrlConvention convention : kAll) {
    const bool fixed = convention == KrlConvention::RcprgTum;
    EXPECT_FALSE(supports(convention, ControlStrategy::Other));
    EXPECT_EQ(supports(convention, ControlStrategy::Position), !fixed);
    EXPECT_EQ(supports(convention, ControlStrategy::CartesianImpedance), !fixed);
    EXPECT_TRUE(supports(convention, ControlStrategy::JointImpedance));
  }
}

}  // namespace
}  // namespace lwr_fri_bridge::fri
