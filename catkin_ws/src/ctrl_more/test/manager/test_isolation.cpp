#include <limits>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

// a adds 1, bad runs the test's function, z adds 10. a and z must work for every fault of bad.
struct Isolation : ::testing::Test {
  Rig rig;
  TestController* bad = nullptr;
  bool misbehave = false;

  void build(std::function<void(TestController&, ModifiedControlStates&)> how,
             ControllerEntry entry = {}, CorrectionLimit limit = {}) {
    rig.add(adder("pose", "ee", 1.0), "a");
    auto c = adder("pose", "ee", 0.0);
    c->description.control_signals[0].limit = limit;
    c->on_write = [this, how](TestController& self, ModifiedControlStates& modified) {
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

TEST_F(Isolation, Exception) {
  build([](TestController&, ModifiedControlStates&) { throw std::runtime_error("sensor gone"); });
  expectFault(FaultKind::Exception, "sensor gone");
}

TEST_F(Isolation, ExceptionNotDerivedFromStdException) {
  build([](TestController&, ModifiedControlStates&) { throw 42; });
  expectFault(FaultKind::Exception, "not a std::exception");
}

TEST_F(Isolation, ReportedFailure) {
  build([](TestController& self, ModifiedControlStates&) { self.fail("no solution"); });
  expectFault(FaultKind::Declared, "no solution");
}

TEST_F(Isolation, Nan) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][2] = std::nan(""); });
  expectFault(FaultKind::NotFinite, "not finite");
}

TEST_F(Isolation, Quaternion) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][6] = 0.9; });
  expectFault(FaultKind::NotUnit, "not unit");
}

TEST_F(Isolation, WrongSize) {
  build([](TestController& self, ModifiedControlStates& m) {
    m.set(self.out, Eigen::VectorXd::Zero(6));
  });
  expectFault(FaultKind::Exception, "size");
}

TEST_F(Isolation, EmptyPermission) {
  build([](TestController&, ModifiedControlStates& m) { m[Modify<>()][0] = 1.0; });
  expectFault(FaultKind::Exception, "permission");
}

TEST_F(Isolation, PermissionOfAnotherController) {
  TestController* other = rig.add(adder("joint", "Velocity", 0.0), "other");
  build([other](TestController&, ModifiedControlStates& m) { m[other->out][0] = 9.0; });
  expectFault(FaultKind::Exception, "permission");
  EXPECT_EQ(rig.joints()[0], 0.1);
}

TEST_F(Isolation, WriteBehindTheBack) {
  // A plug-in that casts constness away: found by the comparison of the test mode.
  build([this](TestController&, ModifiedControlStates&) { rig.control.setCoM({1, 1, 1}); });
  expectFault(FaultKind::Undeclared, "does not name");
  EXPECT_EQ(rig.control.getCoM(), Eigen::Vector3d(0, 0, 0));
}

TEST_F(Isolation, CorrectionTooLarge) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][1] += 1.0; }, {},
        {0.5, kUnlimited, kUnlimited, kUnlimited});
  expectFault(FaultKind::CorrectionSize, "larger");
}

TEST_F(Isolation, CorrectionTooFast) {
  build([](TestController& self, ModifiedControlStates& m) { m[self.out][1] += 0.1; }, {},
        {kUnlimited, 10.0, kUnlimited, kUnlimited});  // 0.05 m per cycle
  expectFault(FaultKind::CorrectionRate, "faster");
}

TEST_F(Isolation, AngleTooLarge) {
  build(
      [](TestController& self, ModifiedControlStates& m) {
        m[self.out].tail<4>() = Eigen::Vector4d(std::sin(0.2), 0, 0, std::cos(0.2));
      },
      {}, {kUnlimited, kUnlimited, 0.3, kUnlimited});
  expectFault(FaultKind::CorrectionSize, "larger");
}

TEST(IsolationTest, TheRateOfATurnIsThatOfItsChange) {
  // A turn of 0.5 rad that grows by 0.014 rad per cycle is within 3 rad/s, however large it is.
  Rig rig;
  double angle = 0.0;
  auto c = adder("pose", "ee", 0.0);
  c->description.control_signals[0].limit = {kUnlimited, kUnlimited, kUnlimited, 3.0};
  c->on_write = [&](TestController& self, ModifiedControlStates& m) {
    angle += 0.014;
    m[self.out].tail<4>() = Eigen::Vector4d(0, std::sin(angle / 2), 0, std::cos(angle / 2));
  };
  rig.add(std::move(c), "c");
  rig.step(36);
  EXPECT_EQ(rig.manager->status("c").fault, FaultKind::None);
  angle += 0.002;
  rig.step();
  EXPECT_EQ(rig.manager->status("c").fault, FaultKind::CorrectionRate);
}

struct Spoilt {
  ControlContainer container;
  const char* key;
  int size;
  bool quaternion;
};

const Spoilt kSignals[] = {{ControlContainer::TaskSpaceReferencePose, "ee", 7, true},
                           {ControlContainer::PelvisOrientation, "pelvis", 4, true},
                           {ControlContainer::CentreOfMass, "com", 3, false},
                           {ControlContainer::TaskSpaceReferenceVel, "ee", 6, false},
                           {ControlContainer::JointSpaceReference, "Velocity", 7, false},
                           {ControlContainer::OtherReference, "samples", 11, false}};

// Kind of fault of a controller that damages one number.
FaultKind spoil(const Spoilt& signal, int index, double value, bool first_is_good = false) {
  Rig rig(0.0, false, false);  // as on a robot: not in the test mode
  rig.control.declare(ControlContainer::OtherReference, "samples", 11, "1", "none");
  auto c = std::make_unique<TestController>();
  if (signal.container == ControlContainer::JointSpaceReference) {
    c->description.stage = Stage::Joint;
  }
  Modify<> good;
  if (first_is_good) {
    c->description.modifies(ControlContainer::JointSpaceReference, "Velocity")
        .in("rad/s")
        .frameOf("joint")
        .about("untouched");
  }
  c->description.modifies(signal.container, signal.key)
      .size(signal.size)
      .in("1")
      .frameOf("w")
      .about("spoilt");
  const std::string role = std::string(nameOf(signal.container)) + "/" + signal.key;
  c->on_initialize = [&](TestController& self, Setup& setup) {
    if (first_is_good) good = setup.modify("jointSpaceReference/Velocity");
    self.out = setup.modify(role);
  };
  c->on_write = [&](TestController& self, ModifiedControlStates& m) { m[self.out][index] = value; };
  rig.add(std::move(c), "c");
  rig.step();
  return rig.manager->status("c").fault;
}

TEST(IsolationTest, EveryNumberOfEveryKindOfSignalIsJudged) {
  for (const Spoilt& signal : kSignals) {
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
  const Spoilt second = {ControlContainer::JointSpaceReference, "Position", 7, false};
  EXPECT_EQ(spoil(second, 6, std::nan(""), true), FaultKind::NotFinite);
  EXPECT_EQ(spoil(second, 6, 0.5, true), FaultKind::None);
}

TEST(IsolationTest, FaultInResetOrGainsChangedIsCaughtToo) {
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

TEST(IsolationTest, FaultIsLoggedWithControllerPlaceAndCycle) {
  Rig rig;
  auto sink = std::make_shared<ListSink>();
  rig.logger.addSink(sink);
  auto c = adder("pose", "ee", 0.0);
  c->on_write = [](TestController&, ModifiedControlStates&) { throw std::runtime_error("boom"); };
  rig.add(std::move(c), "mine");
  rig.step();
  rig.logger.drain();
  EXPECT_TRUE(sink->contains("[ERROR] mine ("));
  EXPECT_TRUE(sink->contains("cycle 1"));
  EXPECT_TRUE(sink->contains("boom"));
}

}  // namespace
}  // namespace ctrl_more
