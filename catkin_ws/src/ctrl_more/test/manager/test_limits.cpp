// Exact limits of the declared bounds of a correction, and the signals to which they apply.
#include "test_support.hpp"

namespace ctrl_more {
namespace {

// A pose and a velocity are modified; only the velocity, the second one, is bounded.
struct TwoSignals : ::testing::Test {
  Rig rig;
  double shift = 0.0, push = 0.0;
  void build(const CorrectionLimit& limit) {
    auto c = adder("pose", "ee", 0.0);
    c->description.modifies(ControlContainer::TaskSpaceReferenceVel, "ee")
        .in("m/s")
        .frameOf("base")
        .bounded(limit)
        .about("pushed");
    auto velocity = std::make_shared<Modify<>>();
    c->on_initialize = [velocity](TestController& self, ctrl_more::Setup& setup) {
      self.out = setup.modify("taskSpaceReferencePose/ee");
      *velocity = setup.modify("taskSpaceReferenceVel/ee");
    };
    c->on_write = [this, velocity](TestController& self, ModifiedControlStates& m) {
      m[self.out][0] += shift;
      m[*velocity][1] += push;
    };
    rig.add(std::move(c), "c");
  }
  FaultKind faultAfter(double wanted_push, int cycles = 1) {
    push = wanted_push;
    rig.step(cycles);
    return rig.manager->status("c").fault;
  }
};

TEST_F(TwoSignals, TheBoundItselfIsAllowed) {
  build({0.5, kUnlimited, kUnlimited, kUnlimited});
  shift = 100.0;  // of the signal without a bound
  EXPECT_EQ(faultAfter(0.5, 3), FaultKind::None);
  EXPECT_EQ(rig.twist()[1], 0.5);
  EXPECT_EQ(rig.pose()[0], 100.0);
  EXPECT_EQ(faultAfter(-0.5), FaultKind::None);
  EXPECT_EQ(faultAfter(0.5000001), FaultKind::CorrectionSize);
  EXPECT_EQ(rig.twist()[1], 0.0);
  EXPECT_EQ(rig.pose()[0], 0.0) << "all signals of the controller are undone";
}

TEST_F(TwoSignals, AfterAPauseTheRateIsNotJudgedOnce) {
  build({kUnlimited, 10.0, kUnlimited, kUnlimited});
  ASSERT_EQ(faultAfter(1.0, 3), FaultKind::None);
  rig.manager->pause("c");
  rig.step(2);
  rig.manager->resume("c");
  EXPECT_EQ(faultAfter(4.0), FaultKind::None);
  EXPECT_EQ(faultAfter(5.0), FaultKind::CorrectionRate);
}

// A signal that is only read has no attribution and cannot be written.
TEST(Limits, ReadSignalsAreNotTheControllersOwn) {
  Rig rig;
  bool behind = false;
  auto c = adder("com", "com", 1.0);
  c->description.reads(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("read");
  const auto add = c->on_update;
  c->on_update = [&, add](TestController& self, const Cycle& cycle, const RobotStates& robot,
                          const ControlStates& original, ModifiedControlStates& m) {
    add(self, cycle, robot, original, m);
    if (behind) rig.control.setZMP({1.0, 0.0, 0.0});
  };
  rig.add(std::move(c), "c");
  rig.step(2);
  ASSERT_EQ(rig.manager->attribution().size(), 1u);
  EXPECT_EQ(rig.manager->attribution()[0].signal, "centreOfMass/com");
  behind = true;
  rig.step();
  EXPECT_EQ(rig.manager->status("c").fault, FaultKind::Undeclared);
  EXPECT_EQ(rig.control.getZMP()[0], 0.0);
}

}  // namespace
}  // namespace ctrl_more
