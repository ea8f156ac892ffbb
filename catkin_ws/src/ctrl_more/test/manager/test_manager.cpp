#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Names = std::vector<std::string>;

// A controller that records its place in the execution order.
std::unique_ptr<TestController> recorder(std::vector<std::string>* log) {
  auto c = adder("pose", "ee", 0.0);
  c->on_write = [log](TestController& self, ModifiedControlStates&) {
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

TEST_F(Three, OrderChangesBetweenCycles) {
  ASSERT_TRUE(rig.manager->setExecutionOrder({"c", "a", "b"}));
  EXPECT_EQ(runOnce(), (Names{"c", "a", "b"}));
  EXPECT_EQ(rig.manager->getControllersNames(), (Names{"a", "b", "c"})) << "load order";
  EXPECT_EQ(rig.manager->getExecutionOrder(), (Names{"c", "a", "b"}));
}

TEST_F(Three, WrongOrdersAreRefusedAndTheOldOneStays) {
  for (const Names& wrong : {Names{}, Names{"b", "unknown", "a"}, Names{"a", "a", "b"},
                             Names{"a", "b"}, Names{"a", "b", "c", "c"}}) {
    const Status status = rig.manager->setExecutionOrder(wrong);
    EXPECT_FALSE(status);
    EXPECT_EQ(status.generation(), 0u);
    EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
  }
  EXPECT_TRUE(contains(rig.manager->setExecutionOrder({"a", "b"}).message(), "missing: c"));
}

TEST_F(Three, DisabledAndPausedOnesDoNotRun) {
  rig.manager->disable("a");
  rig.manager->pause("c");
  EXPECT_EQ(runOnce(), (Names{"b"}));
  rig.manager->enable("a");
  rig.manager->resume("c");
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
}

TEST_F(Three, AllForms) {
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

TEST_F(Three, UnknownNamesAreErrorsNotFalse) {
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

TEST_F(Three, EqualNamesAreRefused) {
  const Status status = rig.manager->addController(recorder(&ran), "b");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "loaded already"));
  EXPECT_FALSE(rig.manager->addController(recorder(&ran), ""));
  EXPECT_FALSE(rig.manager->addController(nullptr, "d"));
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c"}));
}

TEST_F(Three, SeveralChangesAreOneCycleBoundaryAndAllOrNothing) {
  const Status wrong = rig.manager->apply(Change().disable("a").order({"c", "x", "b"}));
  EXPECT_FALSE(wrong);
  EXPECT_TRUE(rig.manager->isEnabled("a")) << "nothing of it happened";
  const Status status =
      rig.manager->apply(Change().disable("a").order({"c", "b", "a"}).pause("b", "test"));
  ASSERT_TRUE(status);
  EXPECT_EQ(runOnce(), (Names{"c"}));
  EXPECT_TRUE(rig.manager->waitAdopted(status.generation(), 0.0));
}

TEST_F(Three, PlanThatWasNotAdoptedCanBeWithdrawn) {
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

TEST_F(Three, PreparedPlanWaitsForItsPlaceInTheCycle) {
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

TEST_F(Three, UnloadOnlyWhenDisabledAndFaded) {
  rig.step();
  EXPECT_FALSE(rig.manager->unload("b"));
  rig.manager->disable("b");
  EXPECT_FALSE(rig.manager->unload("b")) << "the cycle still runs it";
  rig.step();
  EXPECT_TRUE(rig.manager->unload("b"));
  EXPECT_EQ(runOnce(), (Names{"a", "c"}));
  EXPECT_FALSE(rig.manager->has("b"));
}

TEST_F(Three, LoadWhileRunning) {
  rig.step();
  rig.add(recorder(&ran), "d");
  EXPECT_EQ(runOnce(), (Names{"a", "b", "c", "d"}));
  auto needs_more = recorder(&ran);
  needs_more->description.measured("late").size(3).in("m").frameOf("w").about("new key");
  const Status status = rig.manager->addController(std::move(needs_more), "e");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "frozen")) << status.message();
}

TEST(ManagerTest, WithoutAClockCyclesAreCountedAndTimeIsThatOfTheStates) {
  Rig rig;
  std::vector<Cycle> cycles;
  auto c = adder("pose", "ee", 1.0);
  c->on_update = [&](TestController&, const Cycle& cycle, const RobotStates&, const ControlStates&,
                     ModifiedControlStates&) { cycles.push_back(cycle); };
  rig.add(std::move(c), "c");
  rig.control.setControlPeriod(0.002);
  rig.robot.setMeasuredData("imu", vectorOf({1.0}), 77);
  rig.manager->update(rig.robot, nullptr);  // nothing to modify, nothing done
  EXPECT_TRUE(cycles.empty());
  for (int i = 0; i < 3; ++i) rig.manager->update(rig.robot, &rig.control);
  ASSERT_EQ(cycles.size(), 3u);
  for (unsigned i = 0; i < 3; ++i) {
    EXPECT_EQ(cycles[i].number, i + 1);
    EXPECT_EQ(cycles[i].now_ns, 77);
    EXPECT_EQ(cycles[i].dt, 0.002);
  }
  EXPECT_EQ(rig.manager->lastCycle().cycle, 3u);
}

TEST(ManagerTest, StatesOfAnotherLayoutAreUnchangedAndReported) {
  Rig rig;
  auto sink = std::make_shared<ListSink>();
  rig.logger.addSink(sink);
  TestController* c = rig.add(adder("com", "com", 1.0), "c");
  rig.step();
  ControlStates other(0, 0.005, &rig.logger);
  rig.manager->update({0, 0.005, 2}, rig.robot, other);
  EXPECT_EQ(c->updates, 1);
  EXPECT_EQ(other.getCoM(), Eigen::Vector3d(0, 0, 0));
  rig.logger.drain();
  EXPECT_TRUE(sink->contains("expected: nothing run"));
}

}  // namespace
}  // namespace ctrl_more
