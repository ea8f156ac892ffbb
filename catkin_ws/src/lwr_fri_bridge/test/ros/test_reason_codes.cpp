/// Every reason and outcome with a text also has a code.
#include <gtest/gtest.h>

#include <string>

#include <coglab_msgs/ReasonCode.h>

#include "coglab_rt/reason.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"

namespace lwr_fri_bridge {
namespace {

using Code = coglab_msgs::ReasonCode;

std::uint16_t number(MotionBlock block, const CommandModeLoss& loss) {
  return static_cast<std::uint16_t>(codeOf(block, loss));
}

TEST(ReasonCodes, EveryOutcomeHasOne) {
  int values = 0;
  for (int i = 0; i < 256; ++i) {
    Outcome outcome;
    outcome.kind = EventKind::Start;
    outcome.code = static_cast<OutcomeCode>(i);
    if (describe(outcome) == "start") continue;  // no words: no value of the enum
    ++values;
    const std::uint16_t code = static_cast<std::uint16_t>(codeOf(outcome.code));
    EXPECT_NE(code, Code::UNEXPECTED) << describe(outcome);
    EXPECT_EQ(code == Code::NONE, outcome.success() || outcome.code == OutcomeCode::Pending)
        << describe(outcome);
  }
  EXPECT_GE(values, 18);
}

TEST(ReasonCodes, ALossThatTheComputerCausedIsNamed) {
  CommandModeLoss loss;
  loss.cause = LossCause::ComputerLate;
  EXPECT_EQ(number(MotionBlock::Monitor, loss), Code::COMPUTER_LATE);
  EXPECT_EQ(number(MotionBlock::NotStarted, loss), Code::COMPUTER_LATE);
  EXPECT_EQ(number(MotionBlock::Held, loss), Code::HELD);
  loss.cause = LossCause::LeftByController;
  EXPECT_EQ(number(MotionBlock::Monitor, loss), Code::NOT_IN_COMMAND_MODE);
}

}  // namespace
}  // namespace lwr_fri_bridge
