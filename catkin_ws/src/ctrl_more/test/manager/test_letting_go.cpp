#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(LettingGoTest, LastCorrectionFadesAfterAFault) {
  Rig rig(0.1);
  bool wrong = false;
  auto c = adder("pose", "ee", 0.0);
  c->on_write = [&](TestController& self, ModifiedControlStates& m) {
    m[self.out][0] += 1.0;
    if (wrong) throw std::runtime_error("now");
  };
  rig.add(std::move(c), "c");
  rig.step(40);
  ASSERT_EQ(rig.pose()[0], 1.0);
  wrong = true;
  for (int i = 1; i <= 20; ++i) {
    rig.step();
    EXPECT_NEAR(rig.pose()[0], 1.0 - i / 20.0, 1e-12);
  }
  rig.step();
  EXPECT_EQ(rig.pose()[0], 0.0);
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Off);
}

TEST(LettingGoTest, StaleOrMissingInputsStopAndFreshOnesStart) {
  Rig rig(0.1);
  auto c = adder("pose", "ee", 1.0);
  c->description.measured("wrench").size(6).maxAge(0.02);
  TestController* raw = rig.add(std::move(c), "c");
  rig.step(5);
  EXPECT_EQ(raw->updates, 0) << "never written";
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting);
  EXPECT_EQ(rig.manager->status("c").waiting_for, "measuredData/wrench");
  EXPECT_EQ(rig.pose()[0], 0.0);
  rig.robot.setMeasuredData("wrench", Eigen::VectorXd::Zero(6), rig.cycle.now_ns);
  rig.step(4);
  EXPECT_EQ(raw->updates, 4) << "20 ms";
  const double reached = rig.pose()[0];
  EXPECT_NEAR(reached, 0.2, 1e-12) << "blending in over 100 ms";
  double last = reached;
  for (int i = 0; i < 20; ++i) {
    rig.step();
    EXPECT_LE(rig.pose()[0], last) << "fades";
    last = rig.pose()[0];
  }
  EXPECT_EQ(raw->updates, 4);
  EXPECT_EQ(rig.pose()[0], 0.0);
  EXPECT_FALSE(rig.manager->isPaused("c")) << "waiting is no pause";
  for (int i = 0; i < 25; ++i) {
    rig.robot.setMeasuredData("wrench", Eigen::VectorXd::Zero(6), rig.cycle.now_ns);
    rig.step();
  }
  EXPECT_EQ(rig.pose()[0], 1.0);
}

// A sensor that is lost during a pause must not leave the correction on when the pause ends.
TEST(LettingGoTest, CorrectionOfAPauseFadesWhenItResumesWithoutItsSensor) {
  for (const bool fault : {false, true}) {
    Rig rig(0.1, false, false);
    bool wrong = false;
    auto c = adder("pose", "ee", 1.0);
    c->description.measured("wrench").size(1).in("N").frameOf("w").maxAge(0.02).about("needed");
    const auto add = c->on_update;
    c->on_update = [&wrong, add](TestController& self, const Cycle& cycle, const RobotStates& robot,
                                 const ControlStates& original, ModifiedControlStates& modified) {
      if (wrong) throw std::runtime_error("wrong");
      add(self, cycle, robot, original, modified);
    };
    ControllerEntry entry;
    entry.on_fault = StopPolicy::Hold;
    rig.add(std::move(c), "c", true, entry);
    const auto run = [&](int cycles, bool sensor) {
      for (int i = 0; i < cycles; ++i) {
        if (sensor) rig.robot.setMeasuredData("wrench", vectorOf({1.0}), rig.cycle.now_ns);
        rig.step();
      }
    };
    run(60, true);
    ASSERT_EQ(rig.pose()[0], 1.0);
    wrong = fault;
    if (!fault) rig.manager->pause("c");
    run(60, true);
    EXPECT_EQ(rig.pose()[0], 1.0) << "held";
    run(20, false);
    wrong = false;
    rig.manager->resume("c", fault ? "fault" : "user");
    run(5, false);
    EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting);
    EXPECT_EQ(rig.manager->status("c").waiting_for, "measuredData/wrench");
    EXPECT_GT(rig.pose()[0], 0.0);
    run(60, false);
    EXPECT_EQ(rig.pose()[0], 0.0) << "let go";
    run(60, true);
    EXPECT_EQ(rig.pose()[0], 1.0) << "and back";
  }
}

// For a host that stops its arm: it must stand, even if a controller or pause holds a correction.
TEST(LettingGoTest, LetGoRemovesCorrectionsAndThenBlendsInNewOnes) {
  Rig rig(0.1);
  TestController* raw = rig.add(adder("pose", "ee", 1.0), "c");
  rig.add(adder("vel", "ee", 1.0), "paused");
  rig.step(40);
  rig.manager->pause("paused");
  rig.manager->letGo(true);
  const int updates = raw->updates, resets = raw->resets;
  for (int i = 0; i < 10; ++i) {
    rig.step();
    ASSERT_EQ(rig.pose()[0], 0.0);
    ASSERT_EQ(rig.twist()[0], 0.0);
  }
  EXPECT_EQ(raw->updates, updates);
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting);
  EXPECT_EQ(rig.manager->status("c").waiting_for, "a motion");
  rig.manager->letGo(false);
  for (int i = 1; i <= 20; ++i) {
    rig.step();
    ASSERT_NEAR(rig.pose()[0], i / 20.0, 1e-12) << "blended in over 100 ms";
  }
  EXPECT_EQ(raw->resets, resets + 1);
  EXPECT_EQ(rig.twist()[0], 0.0) << "what the pause held is gone";

  rig.manager->letGo(true);
  rig.step();
  rig.manager->disable("c");
  rig.step();
  rig.manager->letGo(false);
  rig.step(3);
  EXPECT_EQ(rig.pose()[0], 0.0) << "nothing old comes back";
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Off);
}

TEST(LettingGoTest, ZeroDropsTheCorrectionInTheSameCycle) {
  for (const bool fault : {false, true}) {
    Rig rig(0.1);
    bool wrong = false;
    auto c = adder("pose", "ee", 0.0);
    c->description.control_signals[0].on_pause = StopPolicy::Zero;
    c->on_write = [&](TestController& self, ModifiedControlStates& m) {
      m[self.out][0] += 1.0;
      if (wrong) self.fail("now");
    };
    ControllerEntry entry;
    entry.on_fault = StopPolicy::Zero;
    rig.add(std::move(c), "c", true, entry);
    rig.step(40);
    ASSERT_EQ(rig.pose()[0], 1.0);
    wrong = fault;
    if (!fault) rig.manager->pause("c");
    rig.step();
    EXPECT_EQ(rig.pose()[0], 0.0) << (fault ? "fault" : "pause");
  }
}

TEST(LettingGoTest, PoliciesByKindHoldAlsoAfterAFault) {
  for (const char* signal : {"pose", "vel"}) {
    Rig rig(0.1);
    bool wrong = false;
    auto c = adder(signal, "ee", 0.0);
    c->on_write = [&](TestController& self, ModifiedControlStates& m) {
      m[self.out][0] += 1.0;
      if (wrong) self.fail("now");
    };
    ControllerEntry entry;
    entry.on_fault = StopPolicy::ByKind;
    rig.add(std::move(c), "c", true, entry);
    rig.step(40);
    wrong = true;
    rig.step(40);
    EXPECT_EQ(rig.pose()[0], signal == std::string("pose") ? 1.0 : 0.0) << "held";
    EXPECT_EQ(rig.twist()[0], 0.0) << "faded";
  }
}

// A controller that waits for its sensor, with a correction that fades meanwhile.
struct Waiting : ::testing::Test {
  Rig rig{0.1};
  Waiting() {
    auto c = adder("pose", "ee", 1.0);
    c->description.measured("wrench").size(6).maxAge(0.02);
    rig.add(std::move(c), "c");
    rig.add(adder("vel", "ee", 0.0), "other");
    for (int i = 0; i < 30; ++i) {
      rig.robot.setMeasuredData("wrench", Eigen::VectorXd::Zero(6), rig.cycle.now_ns);
      rig.step();
    }
    EXPECT_EQ(rig.pose()[0], 1.0);
    EXPECT_EQ(rig.manager->status("c").waiting_for, "");
    rig.step(4);
    EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting);
    EXPECT_EQ(rig.manager->status("c").waiting_for, "measuredData/wrench");
  }
};

TEST_F(Waiting, OtherRequestsDoNotProlongTheFade) {
  for (int i = 0; i < 19; ++i) {
    rig.manager->pause("other", false);
    rig.manager->resume("other");
    EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting);
    rig.step();
  }
  EXPECT_NEAR(rig.pose()[0], 0.0, 1e-12);
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Waiting) << "for as long as it takes";
}

TEST_F(Waiting, PausedWhileWaitingItEndsOff) {
  rig.manager->pause("c");
  rig.step();
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Stopping);
  EXPECT_EQ(rig.manager->status("c").waiting_for, "") << "it waits for nothing any more";
  rig.step(30);
  EXPECT_EQ(rig.manager->status("c").activity, Activity::Off);
  EXPECT_EQ(rig.pose()[0], 0.0);
}

}  // namespace
}  // namespace ctrl_more
