#include <thread>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

// Slow when told so; the clock is the real one, so only "much too slow" is asked for.
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

TEST(OverrunTest, OverrunsAreJudgedWhereAControllerAsksForIt) {
  Rig rig(0.0, false, false);  // the manager itself measures nothing
  auto c = adder("pose", "ee", 1.0);
  c->on_update = [](TestController&, const Cycle&, const RobotStates&, const ControlStates&,
                    ModifiedControlStates&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  };
  ControllerEntry entry;
  entry.overrun_us = 1000.0;
  rig.add(std::move(c), "slow", true, entry);
  rig.step(6);
  EXPECT_EQ(rig.manager->status("slow").fault, FaultKind::Overrun);
  EXPECT_EQ(rig.manager->status("slow").overruns, 5u);
}

// A nanosecond is too short for any update, whatever the machine.
TEST(OverrunTest, FiveInARowPauseAndFiveMoreAfterTheFaultIsCleared) {
  Rig rig(0.0, false, false);
  ControllerEntry entry;
  entry.overrun_us = 0.001;
  rig.add(adder("pose", "ee", 1.0), "c", true, entry);
  for (const unsigned before : {0u, 5u}) {
    for (unsigned i = 1; i <= 5; ++i) {
      rig.step();
      EXPECT_EQ(rig.manager->isPaused("c"), i == 5) << before + i;
      EXPECT_EQ(rig.manager->status("c").overruns, before + i);
      EXPECT_EQ(rig.pose()[0], 0.0) << "never in time, never used";
    }
    EXPECT_EQ(rig.manager->status("c").fault, FaultKind::Overrun);
    rig.manager->resume("c", "fault");
  }
}

TEST(OverrunTest, BothSignalsOfALateUpdateAreThoseOfTheLastInTime) {
  Rig rig(0.0, true);
  bool now = false;
  auto c = adder("pose", "ee", 0.0);
  c->description.modifies(ControlContainer::TaskSpaceReferenceVel, "ee").in("m/s").frameOf("b");
  Modify<> velocity;
  c->on_initialize = [&](TestController& self, ctrl_more::Setup& setup) {
    self.out = setup.modify("taskSpaceReferencePose/ee");
    velocity = setup.modify("taskSpaceReferenceVel/ee");
  };
  c->on_update = [&](TestController& self, const Cycle& cycle, const RobotStates&,
                     const ControlStates&, ModifiedControlStates& m) {
    m[self.out][0] += static_cast<double>(cycle.number);
    m[velocity][5] -= static_cast<double>(cycle.number);
    if (now) std::this_thread::sleep_for(std::chrono::milliseconds(250));
  };
  ControllerEntry entry;
  entry.overrun_us = 200000.0;
  rig.add(std::move(c), "c", true, entry);
  rig.step(3);
  ASSERT_EQ(rig.manager->status("c").overruns, 0u);
  now = true;
  rig.step();
  EXPECT_EQ(rig.manager->status("c").overruns, 1u);
  EXPECT_EQ(rig.pose()[0], 3.0);
  EXPECT_EQ(rig.twist()[5], -3.0);
  EXPECT_EQ(rig.twist()[0], 0.0);
}

TEST(OverrunTest, DurationsAreMeasuredWhereSomebodyAsks) {
  const auto spin = [](double us) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(1e-6 * us);
    while (std::chrono::steady_clock::now() < end) {
    }
  };
  for (const bool timed : {false, true}) {
    Rig rig(0.0, timed, false);
    auto c = adder("pose", "ee", 0.0);
    c->on_update = [&](TestController&, const Cycle&, const RobotStates&, const ControlStates&,
                       ModifiedControlStates&) { spin(3000.0); };
    rig.add(std::move(c), "c");
    const auto before = std::chrono::steady_clock::now();
    rig.step();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - before;
    const double told = rig.manager->status("c").last_us;
    if (!timed) EXPECT_EQ(told, 0.0) << "nobody asked";
    if (timed) EXPECT_GE(told, 3000.0);
    EXPECT_LE(told, 1e6 * took.count()) << "not longer than the cycle it is part of";
    EXPECT_EQ(rig.manager->status("c").overruns, 0u) << "measured, not judged";
  }
}

}  // namespace
}  // namespace ctrl_more
