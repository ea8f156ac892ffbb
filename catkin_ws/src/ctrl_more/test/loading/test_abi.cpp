// ABI numbers that a library and the program that loads it must share.
#include <algorithm>

#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

FeedbackController* makeNothing() { return nullptr; }

// One different number is sufficient for a refusal, which shows both sides.
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
