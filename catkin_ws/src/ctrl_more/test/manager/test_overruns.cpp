#include <thread>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

// Slow on request. The clock is real, so the test uses only "much too slow".
std::unique_ptr<TestController> slow(const bool* now) {
  auto c = adder("pose", "ee", 0.0);
  c->on_update = [now](TestController& self, const Cycle& cycle, const RobotStates&,
                       const ControlStates&, ModifiedControlStates& m) {
    m[self.out][0] += static_cast<double>(cycle.number);
    if (*now) std::this_thread::sleep_for(std::chrono::milliseconds(40));
  };
  return c;
}

TEST(OverrunTest, OverrunsAreUndoneAndPauseAfterFiveInARow) {
  Rig rig(0.0, true);
  bool now = false;
  ControllerEntry entry;
  entry.overrun_us = 30000.0;
  rig.add(slow(&now), "c", true, entry);
  rig.step(3);
  ASSERT_EQ(rig.manager->status("c").overruns, 0u);
  ASSERT_EQ(rig.pose()[0], 3.0);
  now = true;
  for (int i = 1; i <= 4; ++i) {
    rig.step();
    EXPECT_EQ(rig.pose()[0], 3.0) << "undone, the correction of the last cycle in time is used";
    EXPECT_EQ(rig.manager->status("c").overruns, static_cast<unsigned>(i));
    EXPECT_FALSE(rig.manager->isPaused("c"));
  }
  now = false;
  rig.step();
  EXPECT_EQ(rig.pose()[0], 8.0) << "in time again";
  now = true;
  rig.step(4);
  EXPECT_FALSE(rig.manager->isPaused("c")) << "the count starts again";
  rig.step();
  EXPECT_TRUE(rig.manager->isPaused("c"));
  EXPECT_EQ(rig.manager->status("c").fault, FaultKind::Overrun);
  EXPECT_GT(rig.manager->status("c").last_us, 30000.0);
}

TEST(OverrunTest, OverrunsAreNotJudgedInLockstep) {
  Rig rig(0.0, true);
  rig.options.lockstep = true;
  rig.manager = std::make_unique<FeedbackControllersManager>(rig.robot, rig.control, rig.options,
                                                             &rig.logger);
  const bool now = true;
  ControllerEntry entry;
  entry.overrun_us = 1.0;
  rig.add(slow(&now), "c", true, entry);
  rig.step(6);
  EXPECT_EQ(rig.manager->status("c").overruns, 0u);
  EXPECT_EQ(rig.pose()[0], 6.0);
}

}  // namespace
}  // namespace ctrl_more
