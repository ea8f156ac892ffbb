/// Codes and sentences.
#include <gtest/gtest.h>

#include <iterator>
#include <set>
#include <string>

#include "coglab_rt/reason.hpp"

namespace coglab_rt {
namespace {

TEST(Reason, EveryBlockHasWordsACodeOfItsOwnAndTheWayBack) {
  std::set<std::uint16_t> seen;
  for (int i = 0; i < 256; ++i) {
    const auto block = static_cast<MotionBlock>(i);
    if (std::string(describe(block)) == "?") continue;  // no value of the enum
    const auto code = static_cast<std::uint16_t>(codeOf(block));
    EXPECT_EQ(code == 0, block == MotionBlock::None) << describe(block);
    EXPECT_TRUE(seen.insert(code).second) << describe(block);
    EXPECT_EQ(motionBlockOf(code), block) << describe(block);
  }
  EXPECT_EQ(seen.size(), std::size(kBlockCodes));
  EXPECT_EQ(motionBlockOf(12345), MotionBlock::NotStarted);
}

TEST(Reason, IsEmptyOnlyWithoutACode) {
  Reason reason;
  EXPECT_TRUE(reason.empty());
  reason = Reason(ReasonCode::GoalStale, "the goal is ") << 0.25 << " s old";
  EXPECT_FALSE(reason.empty());
  EXPECT_EQ(reason.str(), "the goal is 0.250 s old");
  const Answer answer = Answer::refusal(reason);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.number(), 301);
  EXPECT_EQ(answer.message, reason.str());
  reason.clear();
  EXPECT_TRUE(reason.empty());
}

TEST(Reason, ASentenceHasAtMost199Characters) {
  const std::string longest(199, 'x');
  EXPECT_EQ(Reason(ReasonCode::Busy, (longest + "y").c_str()).str(), longest);
}

}  // namespace
}  // namespace coglab_rt
