#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Names = std::vector<std::string>;

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

TEST_F(BySignal, PauseAndResumeByRobotState) {
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

TEST_F(BySignal, ReasonsDoNotCancelEachOther) {
  rig.manager->pause("force");
  rig.manager->pauseAllUsingRobotState("wrench");
  rig.manager->pauseAllUsingControlState("ee");
  rig.manager->resumeAllUsingRobotState("wrench");
  EXPECT_TRUE(rig.manager->isPaused("force"));
  const Status status = rig.manager->resume("force");
  EXPECT_TRUE(contains(status.message(), "control signal taskSpaceReferencePose/ee"))
      << status.message();
  EXPECT_TRUE(rig.manager->isPaused("force"));
  rig.manager->resumeAllUsingControlState("ee");
  EXPECT_FALSE(rig.manager->isPaused("force"));
}

TEST_F(BySignal, DisableBySignal) {
  rig.manager->disableAllUsingRobotState("object");
  EXPECT_FALSE(rig.manager->isEnabled("vision"));
  EXPECT_TRUE(rig.manager->isEnabled("force"));
  rig.manager->disableAllUsingControlState("ee");
  EXPECT_FALSE(rig.manager->isEnabled("force"));
}

TEST_F(BySignal, ProfilesEnableExactlyTheirControllersAtOneBoundary) {
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

TEST_F(BySignal, MotionSwitchResetsControllersWithResetPolicy) {
  rig.step();
  const int before = force->resets;
  const int held = limits->resets;
  force->description.on_switch = SwitchPolicy::Reset;
  rig.manager->apply(Change().motionSwitched());
  rig.step();
  EXPECT_EQ(force->resets, before + 1);
  EXPECT_EQ(limits->resets, held + 1) << "Reset is the default";
}

TEST_F(BySignal, KeyAndFullNameAreTheSameReason) {
  for (const std::string robot : {"wrench", "measuredData/wrench"}) {
    for (const std::string back : {"wrench", "measuredData/wrench"}) {
      ASSERT_TRUE(rig.manager->pauseAllUsingRobotState(robot));
      EXPECT_EQ(rig.manager->status("force").reasons, Names{"robot signal measuredData/wrench"});
      ASSERT_EQ(rig.manager->status("force").causes.size(), 1U);
      EXPECT_EQ(rig.manager->status("force").causes[0], PauseCause::Signal);
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

TEST_F(BySignal, SafetyControllersAreSkippedInEveryFormOfRequest) {
  using Kind = Change::Kind;
  using Who = Change::Who;
  const std::vector<std::function<Status()>> ways = {
      [&] { return rig.manager->pauseAllUsingControlState("Velocity"); },
      [&] { return rig.manager->disableAllUsingControlState("Velocity"); },
      [&] { return rig.manager->disableAllUsingRobotState("wrench"); },
      [&] {
        return rig.manager->apply(Change().bySignal(Kind::Pause, Who::UsingRobotState, "wrench"));
      },
      [&] { return rig.manager->pause(); },
  };
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const Status status = ways[i]();
    EXPECT_TRUE(status) << i;
    EXPECT_TRUE(contains(status.message(), "limits")) << i;
    EXPECT_TRUE(rig.manager->isEnabled("limits")) << i;
    EXPECT_FALSE(rig.manager->isPaused("limits")) << i;
  }
  EXPECT_FALSE(rig.manager->apply(Change().disable("limits")));
  EXPECT_FALSE(rig.manager->apply(Change().pause("limits")));
  EXPECT_TRUE(rig.manager->apply(Change().enable("limits"))) << "that is no stop";
  EXPECT_TRUE(rig.manager->disableAllUsingControlState("Velocity", true));
  EXPECT_FALSE(rig.manager->isEnabled("limits"));
}

TEST_F(BySignal, ReasonsHaveAName) {
  for (const char* reason : {"", "fault"}) {
    const Status one = rig.manager->apply(Change().pause("force", reason));
    EXPECT_EQ(one.cause(), Cause::InvalidArgument) << one.message();
    EXPECT_TRUE(contains(one.message(), "'fault'")) << one.message();
    EXPECT_FALSE(rig.manager->apply(Change().pause("", reason))) << "nor that of all";
    EXPECT_FALSE(rig.manager->isPaused("force"));
  }
  EXPECT_TRUE(rig.manager->apply(Change().pause("force", "faulty")));
}

TEST_F(BySignal, AppliedProfilesCountAsMotionSwitchesByDefault) {
  ASSERT_TRUE(rig.manager->setProfile("all", {"force", "vision", "limits"}));
  rig.step();
  const int before = force->resets;
  rig.manager->applyProfile("all", false);
  rig.step();
  EXPECT_EQ(force->resets, before);
  rig.manager->applyProfile("all");
  rig.step();
  EXPECT_EQ(force->resets, before + 1);
}

}  // namespace
}  // namespace ctrl_more
