#include <fstream>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Names = std::vector<std::string>;

std::string temporaryFile(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + "/" + name;
  std::ofstream(path) << text;
  return path;
}

// A controller that writes down in which order it runs.
std::unique_ptr<TestController> recorder(std::vector<std::string>* log) {
  auto c = adder("pose", "ee", 0.0);
  c->on_update = [log](TestController& self, const Cycle&, const RobotStates&,
                       const ControlStates&, ModifiedControlStates&) {
    log->push_back(self.getName());
  };
  return c;
}

struct Three : ::testing::Test {
  Rig rig;
  Names ran;
  Three() {
    for (const char* name : {"a", "b", "c"}) rig.add(recorder(&ran), name);
  }
  Names runOnce() {
    ran.clear();
    rig.step();
    return ran;
  }
};

TEST_F(Three, runsInLoadOrderByDefault) {
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
  EXPECT_EQ(rig.manager->getControllersNames(), (Names{"a", "b", "c"}));
  EXPECT_EQ(rig.manager->getExecutionOrder(), (Names{"a", "b", "c"}));
}

TEST_F(Three, orderChangesBetweenCycles) {
  ASSERT_TRUE(rig.manager->setExecutionOrder({"c", "a", "b"}));
  EXPECT_EQ(runOnce(), (Names{"c", "a", "b"}));
  EXPECT_EQ(rig.manager->getControllersNames(), (Names{"a", "b", "c"})) << "load order";
  EXPECT_EQ(rig.manager->getExecutionOrder(), (Names{"c", "a", "b"}));
}

TEST_F(Three, wrongOrdersAreRefusedAndTheOldOneStays) {
  for (const Names& wrong : {Names{}, Names{"b", "unknown", "a"}, Names{"a", "a", "b"},
                             Names{"a", "b"}, Names{"a", "b", "c", "c"}}) {
    const Status status = rig.manager->setExecutionOrder(wrong);
    EXPECT_FALSE(status);
    EXPECT_EQ(status.generation(), 0u);
    EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
  }
  EXPECT_TRUE(contains(rig.manager->setExecutionOrder({"a", "b"}).message(), "missing: c"));
}

TEST_F(Three, disabledAndPausedOnesDoNotRun) {
  rig.manager->disable("a");
  rig.manager->pause("c");
  EXPECT_EQ(runOnce(), (Names{"b"}));
  rig.manager->enable("a");
  rig.manager->resume("c");
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
}

TEST_F(Three, allForms) {
  rig.manager->disable();
  EXPECT_TRUE(runOnce().empty());
  rig.manager->enable();
  EXPECT_EQ(runOnce().size(), 3u);
  rig.manager->pause();
  EXPECT_TRUE(runOnce().empty());
  EXPECT_TRUE(rig.manager->isPaused("b"));
  rig.manager->resume();
  EXPECT_EQ(runOnce().size(), 3u);
}

TEST_F(Three, unknownNamesAreErrorsNotFalse) {
  EXPECT_THROW(rig.manager->isEnabled("x"), std::invalid_argument);
  EXPECT_THROW(rig.manager->isPaused("x"), std::invalid_argument);
  EXPECT_THROW(rig.manager->status("x"), std::invalid_argument);
  EXPECT_FALSE(rig.manager->enable("x"));
  EXPECT_FALSE(rig.manager->pause("x"));
  EXPECT_FALSE(rig.manager->resume("x"));
  EXPECT_FALSE(rig.manager->unload("x"));
  EXPECT_FALSE(rig.manager->setGains("x", {}));
  EXPECT_FALSE(rig.manager->pauseAllUsingRobotState("nothing"));
  EXPECT_FALSE(rig.manager->disableAllUsingControlState("nothing"));
}

TEST_F(Three, equalNamesAreRefused) {
  const Status status = rig.manager->addController(recorder(&ran), "b");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "loaded already"));
  EXPECT_FALSE(rig.manager->addController(recorder(&ran), ""));
  EXPECT_FALSE(rig.manager->addController(nullptr, "d"));
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
}

TEST_F(Three, severalChangesAreOneCycleBoundaryAndAllOrNothing) {
  const Status wrong = rig.manager->apply(Change().disable("a").order({"c", "x", "b"}));
  EXPECT_FALSE(wrong);
  EXPECT_TRUE(rig.manager->isEnabled("a")) << "nothing of it happened";
  const Status status =
      rig.manager->apply(Change().disable("a").order({"c", "b", "a"}).pause("b", "test"));
  ASSERT_TRUE(status);
  EXPECT_EQ(runOnce(), (Names{"c"}));
  EXPECT_TRUE(rig.manager->waitAdopted(status.generation(), 0.0));
}

TEST_F(Three, planIsAcknowledgedOnlyByACycle) {
  const Status status = rig.manager->disable("a");
  EXPECT_FALSE(rig.manager->waitAdopted(status.generation(), 0.01));
  rig.step();
  EXPECT_TRUE(rig.manager->waitAdopted(status.generation(), 0.0));
}

TEST_F(Three, planThatWasNotAdoptedCanBeWithdrawn) {
  rig.step();
  const Status first = rig.manager->disable("a");
  const Status second = rig.manager->disable("b");
  EXPECT_FALSE(rig.manager->withdraw(first.generation())) << "not the newest";
  ASSERT_TRUE(rig.manager->withdraw(second.generation()));
  EXPECT_TRUE(rig.manager->isEnabled("b"));
  EXPECT_EQ(runOnce(), (Names{"b", "c"})) << "the first change is still wanted";
  const Status third = rig.manager->enable("a");
  rig.step();
  EXPECT_FALSE(rig.manager->withdraw(third.generation())) << "adopted";
  EXPECT_TRUE(rig.manager->isEnabled("a"));
}

TEST_F(Three, preparedPlanWaitsForItsPlaceInTheCycle) {
  rig.step();
  ASSERT_TRUE(rig.manager->disable("a"));
  const Status prepared = rig.manager->prepare(Change().disable("b"));
  ASSERT_TRUE(prepared);
  EXPECT_EQ(runOnce(), (Names{"b", "c"})) << "the ordinary change, and no more";
  EXPECT_EQ(runOnce(), (Names{"b", "c"}));
  EXPECT_FALSE(rig.manager->waitAdopted(prepared.generation(), 0.0));
  rig.manager->adoptPrepared();
  EXPECT_TRUE(rig.manager->waitAdopted(prepared.generation(), 0.0));
  EXPECT_EQ(runOnce(), (Names{"c"}));

  // Withdrawn, it never happens; overtaken by an ordinary change, it is part of that.
  const Status second = rig.manager->prepare(Change().enable("a"));
  ASSERT_TRUE(rig.manager->withdraw(second.generation()));
  rig.manager->adoptPrepared();
  EXPECT_EQ(runOnce(), (Names{"c"}));
  ASSERT_TRUE(rig.manager->prepare(Change().enable("a")));
  ASSERT_TRUE(rig.manager->enable("b"));
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
  rig.manager->adoptPrepared();
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
}

TEST_F(Three, anOlderOrdinaryPlanDoesNotOvertakeAPreparedOne) {
  rig.step();
  ASSERT_TRUE(rig.manager->disable("a"));
  const Status prepared = rig.manager->prepare(Change().disable("b"));
  rig.manager->adoptPrepared();
  EXPECT_TRUE(rig.manager->waitAdopted(prepared.generation(), 0.0));
  EXPECT_EQ(runOnce(), (Names{"c"}));
}

TEST_F(Three, unloadOnlyWhenDisabledAndFaded) {
  rig.step();
  EXPECT_FALSE(rig.manager->unload("b"));
  rig.manager->disable("b");
  EXPECT_FALSE(rig.manager->unload("b")) << "the cycle still runs it";
  rig.step();
  EXPECT_TRUE(rig.manager->unload("b"));
  EXPECT_EQ(runOnce(), (Names{"a", "c"}));
  EXPECT_FALSE(rig.manager->has("b"));
}

TEST_F(Three, loadWhileRunning) {
  rig.step();
  rig.add(recorder(&ran), "d");
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c", "d"}));
  auto needs_more = recorder(&ran);
  needs_more->description.measured("late").size(3).in("m").frameOf("w").about("new key");
  const Status status = rig.manager->addController(std::move(needs_more), "e");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "frozen")) << status.message();
}

TEST(ManagerTest, refusedControllerLeavesNoKeyBehind) {
  Rig rig;
  auto c = adder("pose", "ee", 0.1);
  c->description.measured("leftover").size(3);
  c->on_initialize = [](TestController&, ctrl_more::Setup& setup) {
    setup.read("leftover");
    throw std::runtime_error("no");
  };
  EXPECT_FALSE(rig.manager->addController(std::move(c), "a"));
  EXPECT_FALSE(rig.robot.find(RobotSource::Measured, "leftover").valid());
}

struct BySignal : ::testing::Test {
  Rig rig;
  TestController *force, *vision, *limits;
  BySignal() {
    auto f = adder("pose", "ee", 0.1);
    f->description.measured("wrench").size(6);
    force = rig.add(std::move(f), "force");
    auto v = adder("pose", "ee", 0.01);
    v->description.estimated("object").size(3);
    vision = rig.add(std::move(v), "vision");
    auto l = adder("joint", "Velocity", 0.001);
    l->description.safety = true;
    l->description.measured("wrench").size(6);
    limits = rig.add(std::move(l), "limits");
    rig.robot.setMeasuredData("wrench", Eigen::VectorXd::Zero(6), 0);
    rig.robot.setEstimatedData("object", Eigen::VectorXd::Zero(3), 0);
  }
};

TEST_F(BySignal, pauseAndResumeByRobotState) {
  const Status status = rig.manager->pauseAllUsingRobotState("wrench");
  ASSERT_TRUE(status);
  EXPECT_TRUE(contains(status.message(), "limits")) << "a safety controller is left alone, said so";
  EXPECT_TRUE(rig.manager->isPaused("force"));
  EXPECT_FALSE(rig.manager->isPaused("vision"));
  EXPECT_FALSE(rig.manager->isPaused("limits"));
  rig.manager->pauseAllUsingRobotState("wrench", true);
  EXPECT_TRUE(rig.manager->isPaused("limits"));
  rig.manager->resumeAllUsingRobotState("wrench");
  EXPECT_FALSE(rig.manager->isPaused("force"));
  EXPECT_FALSE(rig.manager->isPaused("limits"));
}

TEST_F(BySignal, pauseByEveryWrittenControlState) {
  rig.manager->pauseAllUsingControlState("taskSpaceReferencePose/ee");
  EXPECT_TRUE(rig.manager->isPaused("force"));
  EXPECT_TRUE(rig.manager->isPaused("vision"));
  rig.manager->resumeAllUsingControlState("taskSpaceReferencePose/ee");
  EXPECT_FALSE(rig.manager->isPaused("vision"));
}

TEST_F(BySignal, reasonsDoNotCancelEachOther) {
  rig.manager->pause("force");
  rig.manager->pauseAllUsingRobotState("wrench");
  rig.manager->pauseAllUsingControlState("ee");
  rig.manager->resumeAllUsingRobotState("wrench");
  EXPECT_TRUE(rig.manager->isPaused("force"));
  const Status status = rig.manager->resume("force");
  EXPECT_TRUE(contains(status.message(),
                       "still paused: control signal taskSpaceReferencePose/ee"))
      << status.message();
  EXPECT_TRUE(rig.manager->isPaused("force"));
  rig.manager->resumeAllUsingControlState("ee");
  EXPECT_FALSE(rig.manager->isPaused("force"));
}

TEST_F(BySignal, disableBySignal) {
  rig.manager->disableAllUsingRobotState("object");
  EXPECT_FALSE(rig.manager->isEnabled("vision"));
  EXPECT_TRUE(rig.manager->isEnabled("force"));
  rig.manager->disableAllUsingControlState("ee");
  EXPECT_FALSE(rig.manager->isEnabled("force"));
}

TEST_F(BySignal, safetyControllersMustBeForced) {
  EXPECT_FALSE(rig.manager->pause("limits"));
  EXPECT_FALSE(rig.manager->disable("limits"));
  EXPECT_TRUE(contains(rig.manager->disable().message(), "limits"));
  EXPECT_TRUE(rig.manager->isEnabled("limits"));
  EXPECT_FALSE(rig.manager->isEnabled("force"));
  EXPECT_TRUE(rig.manager->disable("limits", true));
  EXPECT_FALSE(rig.manager->isEnabled("limits"));
}

TEST_F(BySignal, profilesEnableExactlyTheirControllersAtOneBoundary) {
  ASSERT_TRUE(rig.manager->setProfile("dmp", {"limits"}));
  ASSERT_TRUE(rig.manager->setProfile("guided", {"force", "limits"}));
  ASSERT_TRUE(rig.manager->setProfile("none", {}));
  EXPECT_FALSE(rig.manager->setProfile("x", {"unknown"}));
  EXPECT_FALSE(rig.manager->setProfile("x", {"force", "force"}));
  EXPECT_FALSE(rig.manager->setProfile("", {}));
  rig.manager->applyProfile("dmp");
  rig.step();
  EXPECT_EQ(force->updates, 0);
  EXPECT_EQ(limits->updates, 1);
  rig.manager->applyProfile("guided");
  rig.step();
  EXPECT_EQ(force->updates, 1);
  EXPECT_EQ(vision->updates, 0);
  rig.manager->applyProfile("none");
  rig.step();
  EXPECT_EQ(limits->updates, 2) << "an explicit profile also stops safety controllers";
  const Status status = rig.manager->applyProfile("gided");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "did you mean 'guided'"));
  EXPECT_TRUE(rig.manager->hasProfile("dmp"));
  EXPECT_EQ(rig.manager->getProfiles().size(), 3u);
}

TEST_F(BySignal, motionSwitchResetsWhoWantsIt) {
  rig.step();
  const int before = force->resets;
  const int held = limits->resets;
  force->description.on_switch = SwitchPolicy::Reset;
  rig.manager->apply(Change().motionSwitched());
  rig.step();
  EXPECT_EQ(force->resets, before + 1);
  EXPECT_EQ(limits->resets, held + 1) << "Reset is the default";
}

TEST(ManagerTest, stagesAreKeptApart) {
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

TEST(ManagerTest, originalIsTheStateBeforeTheCascade) {
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

TEST(ManagerTest, exclusiveSignalsAreNotShared) {
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

struct WithGain : ::testing::Test {
  Rig rig{0.1};
  TestController* c = nullptr;
  WithGain() {
    auto made = adder("vel", "ee", 0.0);
    made->description.gain("kp", 1.0).range(0, 10).in("1").about("what is added");
    made->description.setting("mode", "fast").oneOf({"fast", "slow"}).about("a mode");
    made->on_initialize = [](TestController& self, ctrl_more::Setup& setup) {
      self.out = setup.modify("ee");
      self.gain_handle = setup.gain("kp");
    };
    made->on_update = [](TestController& self, const Cycle&, const RobotStates&,
                         const ControlStates&, ModifiedControlStates& modified) {
      modified[self.out][0] += self.scalar(self.gain_handle);
    };
    c = rig.add(std::move(made), "c");
    rig.step(40);
  }
};

TEST_F(WithGain, hotReloadBlendsIn) {
  EXPECT_EQ(rig.twist()[0], 1.0);
  const std::string file = temporaryFile("gains.yaml", "kp: 3\n");
  ASSERT_TRUE(rig.manager->loadGains("c", file));
  double last = 1.0;
  for (int i = 0; i < 20; ++i) {
    rig.step();
    EXPECT_NEAR(rig.twist()[0] - last, 0.1, 1e-12) << "2 in 0.1 s";
    last = rig.twist()[0];
  }
  EXPECT_EQ(rig.twist()[0], 3.0);
  rig.step();
  EXPECT_EQ(rig.twist()[0], 3.0);
  EXPECT_EQ(rig.manager->getGains("c").all().at("kp"), std::vector<double>{3.0});
  EXPECT_EQ(c->getGains().at("kp"), std::vector<double>{3.0});
}

TEST_F(WithGain, refusedFilesLeaveTheOldGains) {
  for (const char* text : {"kp: 11\n", "kp: x\n", "kp: [1, 2]\n", "kq: 1\n", "kp: .nan\n", "[1]\n",
                           "kp: 2\nmode: slow\n", "kp: 2\ntype: Other\n", "kp: {a: 1}\n"}) {
    const Status status = rig.manager->loadGains("c", temporaryFile("bad.yaml", text));
    EXPECT_FALSE(status) << text;
    EXPECT_TRUE(contains(status.message(), "bad.yaml")) << status.message();
  }
  EXPECT_TRUE(contains(
      rig.manager->loadGains("c", temporaryFile("bad.yaml", "\n\nkq: 1\n")).message(), ":3:"));
  rig.step(40);
  EXPECT_EQ(rig.twist()[0], 1.0);
  EXPECT_FALSE(rig.manager->reloadGains("c")) << "it was loaded without a file";
  EXPECT_FALSE(rig.manager->setGains("c", {{"kp", {1, 2}}}));
}

TEST_F(WithGain, gainsByNameAndThroughTheInstance) {
  ASSERT_TRUE(rig.manager->setGains("c", {{"kp", {2.0}}}));
  rig.step(40);
  EXPECT_EQ(rig.twist()[0], 2.0);
  ASSERT_TRUE(c->setGains({{"kp", {4.0}}}));
  rig.step(40);
  EXPECT_EQ(rig.twist()[0], 4.0);
}

TEST(ManagerTest, emptyListKeepsEveryBit) {
  Rig rig;
  rig.add(adder("pose", "ee", 1.0), "off", false);
  Eigen::VectorXd pose = vectorOf({-0.0, 1e-310, -5, 0.1, 0.2, 0.3, 0});
  pose[6] = std::sqrt(1.0 - pose.segment<3>(3).squaredNorm());
  rig.control.setTaskSpaceReferencePose("ee", pose);
  const std::vector<double> before(rig.control.data(),
                                   rig.control.data() + rig.control.dataSize());
  for (int i = 0; i < 10; ++i) {
    ++rig.cycle.number;
    rig.manager->update(rig.cycle, rig.robot, rig.control);
    EXPECT_EQ(0, std::memcmp(before.data(), rig.control.data(), before.size() * sizeof(double)));
  }
}

TEST(ManagerTest, secondManagerOverFrozenStoresRunsAtOnce) {
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

TEST(ManagerTest, storesThatTheHostFrozeAreGoodToo) {
  Logger logger;
  RobotStates robot(&logger);
  ControlStates control(0, 0.005, &logger);
  control.freeze();
  FeedbackControllersManager manager(robot, control, {}, &logger);
  ControllerEntry entry;
  entry.enabled = true;
  entry.blend_s = 0.0;
  ASSERT_TRUE(manager.addController(adder("com", "com", 1.0), "a", entry));
  manager.update({0, 0.005, 1}, robot, control);
  EXPECT_EQ(control.getCoM().x(), 1.0);
  EXPECT_TRUE(robot.frozen()) << "both stores are fixed before the first cycle";
}

TEST_F(BySignal, keyAndFullNameAreTheSameReason) {
  for (const std::string robot : {"wrench", "measuredData/wrench"}) {
    for (const std::string back : {"wrench", "measuredData/wrench"}) {
      ASSERT_TRUE(rig.manager->pauseAllUsingRobotState(robot));
      EXPECT_EQ(rig.manager->status("force").reasons,
                Names{"robot signal measuredData/wrench"});
      ASSERT_TRUE(rig.manager->resumeAllUsingRobotState(back));
      EXPECT_FALSE(rig.manager->isPaused("force")) << robot << " " << back;
    }
  }
  for (const std::string back : {"ee", "taskSpaceReferencePose/ee"}) {
    ASSERT_TRUE(rig.manager->pauseAllUsingControlState("ee"));
    ASSERT_TRUE(rig.manager->resumeAllUsingControlState(back));
    for (const auto& status : rig.manager->statusAll()) EXPECT_FALSE(status.paused) << status.name;
  }
}

TEST(ManagerTest, statesAreThoseOfTheCycle) {
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
  c->on_update = [](TestController& self, const Cycle&, const RobotStates&, const ControlStates&,
                    ModifiedControlStates& modified) { modified[self.out][0] = self.updates; };
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
