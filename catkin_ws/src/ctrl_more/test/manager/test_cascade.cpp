#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(CascadeTest, StagesAreKeptApart) {
  Rig rig;
  rig.add(adder("joint", "Velocity", 1.0), "j");
  rig.add(adder("pose", "ee", 1.0), "t");
  rig.setReferences();
  rig.cycle.number = 1;
  rig.manager->beginCycle(rig.cycle);
  rig.manager->updateStage(Stage::Task, rig.robot, rig.control);
  EXPECT_EQ(rig.pose()[0], 1.0);
  EXPECT_EQ(rig.joints()[0], 0.1);
  rig.manager->updateStage(Stage::Joint, rig.robot, rig.control);
  EXPECT_EQ(rig.joints()[0], 1.1);
  rig.manager->endCycle();
}

TEST(CascadeTest, OriginalIsTheStateBeforeTheCascade) {
  Rig rig;
  std::vector<double> originals, found;
  const auto make = [&] {
    auto c = adder("pose", "ee", 0.0);
    c->on_update = [&](TestController& self, const Cycle&, const RobotStates&,
                       const ControlStates& original, ModifiedControlStates& modified) {
      originals.push_back(original.view(self.out.signal())[0]);
      found.push_back(modified.view(self.out)[0]);
      modified[self.out][0] += 1.0;
    };
    return c;
  };
  rig.add(make(), "a");
  rig.add(make(), "b");
  rig.step(1, 5.0);
  EXPECT_EQ(originals, (std::vector<double>{5, 5}));
  EXPECT_EQ(found, (std::vector<double>{5, 6}));
  EXPECT_EQ(rig.pose()[0], 7.0);
}

TEST(CascadeTest, ExclusiveSignalsAreNotShared) {
  Rig rig;
  auto alone = adder("pose", "ee", 0.1);
  alone->description.control_signals[0].exclusive = true;
  rig.add(std::move(alone), "alone");
  rig.add(adder("pose", "ee", 0.1), "other", false);
  const Status status = rig.manager->enable("other");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "both modify taskSpaceReferencePose/ee"));
  EXPECT_TRUE(rig.manager->apply(Change().disable("alone").enable("other")));
  ControllerEntry enabled;
  enabled.enabled = true;
  auto second = adder("pose", "ee", 0.1);
  second->description.control_signals[0].exclusive = true;
  EXPECT_FALSE(rig.manager->addController(std::move(second), "second", enabled));
  EXPECT_FALSE(rig.manager->has("second"));
}

TEST(CascadeTest, EmptyListKeepsEveryBit) {
  Rig rig;
  rig.add(adder("pose", "ee", 1.0), "off", false);
  Eigen::VectorXd pose = vectorOf({-0.0, 1e-310, -5, 0.1, 0.2, 0.3, 0});
  pose[6] = std::sqrt(1.0 - pose.segment<3>(3).squaredNorm());
  rig.control.setTaskSpaceReferencePose("ee", pose);
  const std::vector<double> before(rig.control.data(), rig.control.data() + rig.control.dataSize());
  for (int i = 0; i < 10; ++i) {
    ++rig.cycle.number;
    rig.manager->update(rig.cycle, rig.robot, rig.control);
    EXPECT_EQ(0, std::memcmp(before.data(), rig.control.data(), before.size() * sizeof(double)));
  }
}

TEST(CascadeTest, SecondManagerOverFrozenStoresRunsAtOnce) {
  for (const bool keys : {false, true}) {
    Logger logger;
    RobotStates robot(&logger);
    ControlStates control(0, 0.005, &logger);
    if (keys) control.declare(ControlContainer::Zmp, "other", 3);
    ManagerOptions options;
    options.blend_s = 0.0;
    FeedbackControllersManager first(robot, control, options, &logger);
    FeedbackControllersManager second(robot, control, options, &logger);
    ControllerEntry entry;
    entry.enabled = true;
    ASSERT_TRUE(first.addController(adder("com", "com", 1.0), "a", entry));
    first.update({0, 0.005, 1}, robot, control);
    ASSERT_TRUE(second.addController(adder("com", "com", 2.0), "b", entry));
    second.update({0, 0.005, 1}, robot, control);
    EXPECT_EQ(control.getCoM().x(), 3.0);
    EXPECT_EQ(second.attribution().size(), 1u);
  }
}

TEST(CascadeTest, StatesAreThoseOfTheCycle) {
  class Shows : public TestController {
   public:
    void state(Numbers<> values) const override {
      values[0] = updates;
      values[1] = -updates;
      if (wrong) values[2] = 1.0;
    }
    bool wrong = false;
  };
  Rig rig;
  auto c = std::make_unique<Shows>();
  Shows* const shows = c.get();
  c->description.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("moved");
  c->description.state("count").in("1").about("updates");
  c->description.state("minus").in("1").about("the same, negative");
  c->on_initialize = [](TestController& self, ctrl_more::Setup& setup) {
    self.out = setup.modify("zmp");
  };
  c->on_write = [](TestController& self, ModifiedControlStates& modified) {
    modified[self.out][0] = self.updates;
  };
  ControllerEntry entry;
  entry.on_fault = StopPolicy::Hold;
  rig.add(std::move(c), "shows", true, entry);
  rig.add(adder("com", "com", 1.0), "silent", false);
  for (int i = 1; i <= 5; ++i) {
    rig.step();
    const CycleRecord record = rig.manager->lastCycle();
    EXPECT_EQ(record.cycle, rig.cycle.number);
    ASSERT_EQ(record.states.size(), 1u);
    EXPECT_EQ(record.states[0].controller, "shows");
    EXPECT_EQ(record.states[0].values, (std::vector<double>{1.0 * i, -1.0 * i}));
    ASSERT_EQ(record.changes.size(), 1u);
    EXPECT_EQ(record.changes[0].after[0], i);
  }
  // Writing beside the numbers is a fault; what was written last is shown while it stands.
  shows->wrong = true;
  rig.step();
  EXPECT_TRUE(contains(rig.manager->status("shows").fault_text, "beside"));
  rig.step(3);
  const CycleRecord record = rig.manager->lastCycle();
  ASSERT_EQ(record.states.size(), 1u);
  EXPECT_EQ(record.states[0].values[0], 6.0);
  EXPECT_EQ(record.changes[0].after[0], 5.0) << "the last good one is held";
}

}  // namespace
}  // namespace ctrl_more
