// What a library and the program that loads it must have in common.
#include <algorithm>

#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

FeedbackController* makeNothing() { return nullptr; }

// Every class that both sides touch has its size in the check, those that a controller gets by
// reference included.
TEST(AbiOfControllers, HasTheSizeOfEveryClassThatCrosses) {
  const Abi abi = thisAbi();
  std::vector<std::size_t> kept(abi.sizes.begin(), abi.sizes.end());
  const auto take = [&kept](std::size_t size) {
    const auto found = std::find(kept.begin(), kept.end(), size);
    if (found == kept.end()) return false;
    kept.erase(found);
    return true;
  };
  EXPECT_TRUE(take(sizeof(FeedbackController)));
  EXPECT_TRUE(take(sizeof(Description)));
  EXPECT_TRUE(take(sizeof(RobotSignalUse)));
  EXPECT_TRUE(take(sizeof(ControlSignalUse)));
  EXPECT_TRUE(take(sizeof(GainSpec)));
  EXPECT_TRUE(take(sizeof(SettingSpec)));
  EXPECT_TRUE(take(sizeof(StateSpec)));
  EXPECT_TRUE(take(sizeof(ctrl_more::Setup)));
  EXPECT_TRUE(take(sizeof(Cycle)));
  EXPECT_TRUE(take(sizeof(RobotStates)));
  EXPECT_TRUE(take(sizeof(ControlStates)));
  EXPECT_TRUE(take(sizeof(ModifiedControlStates)));
  EXPECT_TRUE(take(sizeof(Numbers<>)));
}

// One number that differs is enough, whichever it is, and the refusal shows both sides.
TEST(AbiOfControllers, AnyOtherNumberIsRefused) {
  std::vector<Abi> others(4, thisAbi());
  ++others[0].interface;
  ++others[1].compiler_abi;
  ++others[2].eigen;
  others[3].eigen_align *= 2;
  for (std::size_t i = 0; i < thisAbi().sizes.size(); ++i) {
    others.push_back(thisAbi());
    others.back().sizes[i] += sizeof(double);
  }
  prototypes().takeRefused();
  for (const Abi& other : others) {
    EXPECT_FALSE(prototypes().insert({"OfAnotherBuild", &makeNothing}, other)) << other.text();
    const auto refused = prototypes().takeRefused();
    ASSERT_EQ(refused.size(), 1u) << other.text();
    EXPECT_TRUE(contains(refused[0].clause, other.text())) << refused[0].clause;
    EXPECT_TRUE(contains(refused[0].clause, thisAbi().text())) << refused[0].clause;
  }
  EXPECT_EQ(prototypes().find("OfAnotherBuild"), nullptr);
}

}  // namespace
}  // namespace ctrl_more
