#include <limits>
#include <thread>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

// a adds 1, bad does what the test says, z adds 10: whatever bad does, a and z must count.
struct Isolation : ::testing::Test {
  Rig rig;
  TestController* bad = nullptr;
  bool misbehave = false;

  void build(std::function<void(TestController&, ModifiedControlStates&)> how,
             ControllerEntry entry = {}, CorrectionLimit limit = {}) {
    rig.add(adder("pose", "ee", 1.0), "a");
    auto c = adder("pose", "ee", 0.0);
    c->description.control_signals[0].limit = limit;
    c->on_update = [this, how](TestController& self, const Cycle&, const RobotStates&,
                               const ControlStates&, ModifiedControlStates& modified) {
      modified[self.out][1] += 0.25;
      if (misbehave) how(self, modified);
    };
    bad = rig.add(std::move(c), "bad", true, entry);
    rig.add(adder("pose", "ee", 10.0), "z");
    rig.step(3);
    EXPECT_DOUBLE_EQ(rig.pose()[1], 0.45);
  }

  void expectFault(FaultKind kind, const std::string& text) {
    misbehave = true;
    rig.step();
    EXPECT_EQ(rig.pose()[0], 11.0) << "the rest runs in the same cycle";
    EXPECT_DOUBLE_EQ(rig.pose()[1], 0.2) << "its writes are undone in the same cycle";
    EXPECT_NEAR(rig.pose().tail(4).norm(), 1.0, 1e-12);
    const ControllerStatus status = rig.manager->status("bad");
    EXPECT_EQ(status.fault, kind);
    EXPECT_TRUE(status.paused);
    EXPECT_TRUE(rig.manager->isPaused("bad"));
    EXPECT_TRUE(contains(status.fault_text, text)) << status.fault_text;
    EXPECT_EQ(status.faults, 1u);
    EXPECT_EQ(status.fault_cycle, rig.cycle.number);
    const int updates = bad->updates;
    misbehave = false;
    rig.step(3);
    EXPECT_EQ(bad->updates, updates) << "paused";
    EXPECT_EQ(rig.pose()[0], 11.0);
    // A fault is a reason of its own.
    rig.manager->resume("bad");
    EXPECT_TRUE(rig.manager->isPaused("bad"));
    rig.manager->resume("bad", "fault");
    rig.step();
    EXPECT_FALSE(rig.manager->isPaused("bad"));
    EXPECT_EQ(bad->updates, updates + 1);
    EXPECT_EQ(bad->resets, 2) << "reset after a fault";
    EXPECT_DOUBLE_EQ(rig.pose()[1], 0.45);
  }
};

TEST_F(Isolation, exception) {
  build([](TestController&, ModifiedControlStates&) { throw std::runtime_error("sensor gone"); });
  expectFault(FaultKind::Exception, "sensor gone");
}

TEST_F(Isolation, exceptionThatIsNone) {
  build([](TestController&, ModifiedControlStates&) { throw 42; });
  expectFault(FaultKind::Exception, "not a std::exception");
}

TEST_F(Isolation, reportedFailure) {
  build([](TestController& self, ModifiedControlStates&) { self.fail("no solution"); });
  expectFault(FaultKind::Declared, "no solution");
}

TEST_F(Isolation, nan) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][2] = std::nan(""); });
  expectFault(FaultKind::NotFinite, "not finite");
}

TEST_F(Isolation, infinity) {
  build([](TestController& self, ModifiedControlStates& m) {
    m[self.out][0] = std::numeric_limits<double>::infinity();
  });
  expectFault(FaultKind::NotFinite, "not finite");
}

TEST_F(Isolation, quaternion) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][6] = 0.9; });
  expectFault(FaultKind::NotUnit, "not unit");
}

TEST_F(Isolation, wrongSize) {
  build([](TestController& self, ModifiedControlStates& m) {
    m.set(self.out, Eigen::VectorXd::Zero(6));
  });
  expectFault(FaultKind::Exception, "size");
}

TEST_F(Isolation, emptyPermission) {
  build([](TestController&, ModifiedControlStates& m) { m[Modify<>()][0] = 1.0; });
  expectFault(FaultKind::Exception, "permission");
}

TEST_F(Isolation, someoneElsesPermission) {
  TestController* other = rig.add(adder("joint", "Velocity", 0.0), "other");
  build([other](TestController&, ModifiedControlStates& m) { m[other->out][0] = 9.0; });
  expectFault(FaultKind::Exception, "permission");
  EXPECT_EQ(rig.joints()[0], 0.1);
}

TEST_F(Isolation, writeBehindTheBack) {
  // A plug-in that casts constness away: found by the comparison of the test mode.
  build([this](TestController&, ModifiedControlStates&) { rig.control.setCoM({1, 1, 1}); });
  expectFault(FaultKind::Undeclared, "does not name");
  EXPECT_EQ(rig.control.getCoM(), Eigen::Vector3d(0, 0, 0));
}

TEST_F(Isolation, correctionTooLarge) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][1] += 1.0; }, {},
        {0.5, kUnlimited, kUnlimited, kUnlimited});
  expectFault(FaultKind::CorrectionSize, "larger");
}

TEST_F(Isolation, correctionTooFast) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][1] += 0.1; }, {},
        {kUnlimited, 10.0, kUnlimited, kUnlimited});  // 0.05 m per cycle
  expectFault(FaultKind::CorrectionRate, "faster");
}

TEST_F(Isolation, angleTooLarge) {
  build(
      [](TestController& self, ModifiedControlStates& m) {
        m[self.out].tail<4>() = Eigen::Vector4d(std::sin(0.2), 0, 0, std::cos(0.2));
      },
      {}, {kUnlimited, kUnlimited, 0.3, kUnlimited});
  expectFault(FaultKind::CorrectionSize, "larger");
}

struct Signal {
  ControlContainer container;
  const char* key;
  int size;
  bool quaternion;
};

const Signal kSignals[] = {
    {ControlContainer::TaskSpaceReferencePose, "ee", 7, true},
    {ControlContainer::PelvisOrientation, "pelvis", 4, true},
    {ControlContainer::CentreOfMass, "com", 3, false},
    {ControlContainer::TaskSpaceReferenceVel, "ee", 6, false},
    {ControlContainer::JointSpaceReference, "Velocity", 7, false},
    {ControlContainer::OtherReference, "samples", 11, false}};

// What a controller that spoils one number is faulted for.
FaultKind spoil(const Signal& signal, int index, double value, bool first_is_good = false) {
  Rig rig(0.0, false, false);  // as on a robot: not in the test mode
  rig.control.declare(ControlContainer::OtherReference, "samples", 11, "1", "none");
  auto c = std::make_unique<TestController>();
  if (signal.container == ControlContainer::JointSpaceReference) {
    c->description.stage = Stage::Joint;
  }
  Modify<> good;
  if (first_is_good) {
    c->description.modifies(ControlContainer::JointSpaceReference, "Velocity").in("rad/s")
        .frameOf("joint").about("untouched");
  }
  c->description.modifies(signal.container, signal.key).size(signal.size).in("1").frameOf("w")
      .about("spoilt");
  const std::string role = std::string(nameOf(signal.container)) + "/" + signal.key;
  c->on_initialize = [&](TestController& self, Setup& setup) {
    if (first_is_good) good = setup.modify("jointSpaceReference/Velocity");
    self.out = setup.modify(role);
  };
  c->on_update = [&](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                     ModifiedControlStates& m) { m[self.out][index] = value; };
  rig.add(std::move(c), "c");
  rig.step();
  return rig.manager->status("c").fault;
}

TEST(IsolationTest, everyNumberOfEveryKindOfSignalIsJudged) {
  for (const Signal& signal : kSignals) {
    for (int i = 0; i < signal.size; ++i) {
      for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(),
                               -std::numeric_limits<double>::infinity()}) {
        EXPECT_EQ(spoil(signal, i, bad), FaultKind::NotFinite) << signal.key << ' ' << i;
      }
    }
    if (signal.quaternion) {
      EXPECT_EQ(spoil(signal, signal.size - 1, 0.999), FaultKind::NotUnit) << signal.key;
      EXPECT_EQ(spoil(signal, signal.size - 1, 1.0 + 1e-7), FaultKind::None) << signal.key;
    } else {
      // Large numbers are finite, whatever their sum is.
      EXPECT_EQ(spoil(signal, 0, 1.7e308), FaultKind::None) << signal.key;
    }
  }
  // The second signal of a controller too.
  const Signal second = {ControlContainer::JointSpaceReference, "Position", 7, false};
  EXPECT_EQ(spoil(second, 6, std::nan(""), true), FaultKind::NotFinite);
  EXPECT_EQ(spoil(second, 6, 0.5, true), FaultKind::None);
}

TEST(IsolationTest, sumBeyondTheRangeOfNumbersIsNoFault) {
  Rig rig(0.0, false, false);
  auto c = adder("com", "com", 0.0);
  c->on_update = [](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                    ModifiedControlStates& m) { m[self.out].setConstant(1.7e308); };
  rig.add(std::move(c), "c");
  rig.step();
  EXPECT_EQ(rig.manager->status("c").fault, FaultKind::None);
  EXPECT_EQ(rig.control.getCoM()[1], 1.7e308);
}

TEST(IsolationTest, secondSignalIsUndoneRecordedAndFadesLikeTheFirst) {
  Rig rig(0.1, true, false);
  bool wrong = false;
  auto c = adder("pose", "ee", 0.0);
  c->description.modifies(ControlContainer::TaskSpaceReferenceVel, "ee").in("m/s").frameOf("base")
      .about("pushed");
  Modify<> velocity;
  c->on_initialize = [&](TestController& self, ctrl_more::Setup& setup) {
    self.out = setup.modify("taskSpaceReferencePose/ee");
    velocity = setup.modify("taskSpaceReferenceVel/ee");
  };
  c->on_update = [&](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                     ModifiedControlStates& m) {
    m[self.out][0] += 1.0;
    m[velocity][5] += 2.0;
    if (wrong) m[velocity][0] = std::nan("");
  };
  rig.add(std::move(c), "c");
  rig.step(40);
  ASSERT_EQ(rig.twist()[5], 2.0);
  const std::vector<Attribution> list = rig.manager->attribution();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[1].signal, "taskSpaceReferenceVel/ee");
  EXPECT_EQ(list[1].before[5], 0.0);
  EXPECT_EQ(list[1].after[5], 2.0);
  EXPECT_EQ(list[0].size, 1.0);
  wrong = true;
  for (int i = 1; i <= 20; ++i) {
    rig.step();
    EXPECT_NEAR(rig.pose()[0], 1.0 - i / 20.0, 1e-12);
    EXPECT_NEAR(rig.twist()[5], 2.0 - i / 10.0, 1e-12);
    EXPECT_EQ(rig.twist()[0], 0.0);
  }
}

TEST(IsolationTest, faultInResetOrGainsChangedIsCaughtToo) {
  class Throwing : public TestController {
   public:
    void gainsChanged() override { throw std::runtime_error("gains do not suit"); }
  };
  Rig rig;
  auto c = std::make_unique<Throwing>();
  c->description.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("x");
  ControllerEntry entry;
  entry.enabled = true;
  ASSERT_TRUE(rig.manager->addController(std::move(c), "c", entry));
  rig.step();
  EXPECT_TRUE(contains(rig.manager->status("c").fault_text, "gains do not suit"));
}

TEST(IsolationTest, faultIsLoggedWithControllerPlaceAndCycle) {
  Rig rig;
  auto sink = std::make_shared<ListSink>();
  rig.logger.addSink(sink);
  auto c = adder("pose", "ee", 0.0);
  c->on_update = [](TestController&, const Cycle&, const RobotStates&, const ControlStates&,
                    ModifiedControlStates&) { throw std::runtime_error("boom"); };
  rig.add(std::move(c), "mine");
  rig.step();
  rig.logger.drain();
  EXPECT_TRUE(sink->contains("[ERROR] mine ("));
  EXPECT_TRUE(sink->contains("cycle 1"));
  EXPECT_TRUE(sink->contains("boom"));
}

TEST(IsolationTest, lastCorrectionFadesAfterAFault) {
  Rig rig(0.1);
  bool wrong = false;
  auto c = adder("pose", "ee", 0.0);
  c->on_update = [&](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                     ModifiedControlStates& m) {
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

TEST(IsolationTest, faultPolicyHoldAndZero) {
  for (const StopPolicy policy : {StopPolicy::Hold, StopPolicy::Zero}) {
    Rig rig(0.1);
    bool wrong = false;
    auto c = adder("pose", "ee", 0.0);
    c->on_update = [&](TestController& self, const Cycle&, const RobotStates&,
                       const ControlStates&, ModifiedControlStates& m) {
      m[self.out][0] += 1.0;
      if (wrong) self.fail("now");
    };
    ControllerEntry entry;
    entry.on_fault = policy;
    rig.add(std::move(c), "c", true, entry);
    rig.step(40);
    wrong = true;
    rig.step(50);
    EXPECT_EQ(rig.pose()[0], policy == StopPolicy::Hold ? 1.0 : 0.0);
  }
}

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

TEST(IsolationTest, overrunsAreUndoneAndPauseAfterFiveInARow) {
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

TEST(IsolationTest, overrunsAreNotJudgedInLockstep) {
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

TEST(IsolationTest, attributionNamesWhoChangedWhatByHowMuch) {
  Rig rig;
  rig.add(adder("pose", "ee", 1.0), "a");
  rig.add(adder("pose", "ee", -0.25), "b");
  rig.add(adder("pose", "ee", 9.0), "off", false);
  auto turning = adder("pose", "ee", 0.0);
  turning->on_update = [](TestController& self, const Cycle&, const RobotStates&,
                          const ControlStates&, ModifiedControlStates& m) {
    m[self.out].tail<4>() = Eigen::Vector4d(0, std::sin(0.15), 0, std::cos(0.15));
  };
  rig.add(std::move(turning), "turn");
  rig.step(2, 5.0);
  const std::vector<Attribution> list = rig.manager->attribution();
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[0].controller, "a");
  EXPECT_EQ(list[0].signal, "taskSpaceReferencePose/ee");
  EXPECT_EQ(list[0].cycle, rig.cycle.number);
  EXPECT_EQ(list[0].before[0], 5.0);
  EXPECT_EQ(list[0].after[0], 6.0);
  EXPECT_EQ(list[0].size, 1.0);
  EXPECT_EQ(list[1].before, list[0].after) << "a chain without a gap";
  EXPECT_EQ(list[1].size, 0.25);
  EXPECT_EQ(list[2].controller, "turn");
  EXPECT_NEAR(list[2].angle, 0.3, 1e-12);
}

TEST(IsolationTest, attributionIsOfTheLastCycleHoweverOftenItIsAsked) {
  Rig rig;
  double amount = 0.0;
  auto c = adder("pose", "ee", 0.0);
  c->on_update = [&](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                     ModifiedControlStates& m) { m[self.out][0] += amount; };
  rig.add(std::move(c), "c");
  for (int i = 1; i <= 7; ++i) {
    amount = i;
    rig.step(i % 3 + 1);
    for (int asked = 0; asked < i % 4; ++asked) {
      const std::vector<Attribution> list = rig.manager->attribution();
      ASSERT_EQ(list.size(), 1u);
      EXPECT_EQ(list[0].cycle, rig.cycle.number);
      EXPECT_EQ(list[0].size, i);
    }
  }
  rig.manager->beginCycle({0, 0.005, 1000});  // a cycle is running: what is complete is given
  const std::vector<Attribution> meanwhile = rig.manager->attribution();
  ASSERT_EQ(meanwhile.size(), 1u);
  EXPECT_EQ(meanwhile[0].cycle, rig.cycle.number);
}

TEST(IsolationTest, staleOrMissingInputsStopAndFreshOnesStart) {
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
TEST(IsolationTest, correctionOfAPauseFadesWhenItResumesWithoutItsSensor) {
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

TEST(IsolationTest, overrunsAreJudgedWhereAControllerAsksForIt) {
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

}  // namespace
}  // namespace ctrl_more
