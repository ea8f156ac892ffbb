// ABI numbers that libraries of motion controllers and motions must share with the program.
#include <algorithm>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "coglab_controllers/motion/custom_motion_controller.hpp"

namespace coglab_controllers {
namespace {

using ctrl_more::Abi;

/// True if the ABI numbers contain the size of each of these classes.
template <typename... Crossing>
testing::AssertionResult hasSizesOf(const Abi& abi) {
  std::vector<std::size_t> kept(abi.sizes.begin(), abi.sizes.end());
  for (const std::size_t size : {sizeof(Crossing)...}) {
    const auto found = std::find(kept.begin(), kept.end(), size);
    if (found == kept.end()) return testing::AssertionFailure() << size << " in " << abi.text();
    kept.erase(found);
  }
  return testing::AssertionSuccess();
}

/// Copies of these numbers, each with one number changed.
std::vector<Abi> othersThan(const Abi& abi) {
  std::vector<Abi> others(4, abi);
  ++others[0].interface;
  ++others[1].compiler_abi;
  ++others[2].eigen;
  others[3].eigen_align *= 2;
  for (std::size_t i = 0; i < abi.sizes.size(); ++i) {
    others.push_back(abi);
    others.back().sizes[i] += sizeof(double);
  }
  return others;
}

class Nothing : public Motion<> {
 public:
  void configure(MotionConfiguration&) override {}
  void start(const MotionStart<>&) override {}
  void computeReference(const MotionCycle&, MotionReference&) override {}
  MotionState state() const override { return MotionState::Reached; }
};

TEST(AbiOfMotions, ContainsTheSizeOfEverySharedClass) {
  EXPECT_TRUE((hasSizesOf<MotionController, MotionSetup, CycleInput, References, MotionRequest,
                          RobotSample, RobotSetup, Reason>(motionAbi())));
  EXPECT_TRUE(
      (hasSizesOf<Motion<>, MotionConfiguration, MotionArgument, MotionArguments, MotionStart<>,
                  SetPoint, MotionCycle, IkResult, MotionReference>(customMotionAbi())));
}

TEST(AbiOfMotions, AControllerOfAnotherBuildIsRefused) {
  const MotionMaker maker{[]() -> MotionController* { return nullptr; }, nullptr};
  for (const Abi& other : othersThan(motionAbi())) {
    MotionTypes::instance().takeRefused();
    EXPECT_FALSE(MotionTypes::instance().insert("test/OfAnotherBuild", maker, other));
    const auto refused = MotionTypes::instance().takeRefused();
    ASSERT_EQ(refused.size(), 1u);
    EXPECT_NE(refused[0].clause.find(other.text()), std::string::npos) << refused[0].clause;
  }
}

/// A class derived from Motion<> uses more classes than a controller.
TEST(AbiOfMotions, AMotionOfAnotherBuildIsRefused) {
  std::unique_ptr<MotionController> own(CustomMotionController::make(std::make_unique<Nothing>()));
  EXPECT_NE(own, nullptr);
  for (const Abi& other : othersThan(customMotionAbi())) {
    try {
      std::unique_ptr<MotionController> made(
          CustomMotionController::make(std::make_unique<Nothing>(), other));
      ADD_FAILURE() << "taken: " << other.text();
    } catch (const std::runtime_error& error) {
      const std::string said = error.what();
      EXPECT_NE(said.find("build it again"), std::string::npos) << said;
      EXPECT_NE(said.find(other.text()), std::string::npos) << said;
    }
  }
}

}  // namespace
}  // namespace coglab_controllers
