// Controllers are unloaded, or none is active: nothing stays loaded, and the arm does not move.
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::vector<std::string> loaded(ControllerManager& manager) {
  std::vector<std::string> ids, types;
  manager.list(ids, types);
  return ids;
}

TEST(Unload, GoesWithItsServicesAndItsIdIsFreeAgain) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  ControllerManager& manager = *robot.manager;
  std::weak_ptr<const LoadedMotion> watched;
  std::string seen;
  ASSERT_TRUE(VirtualRobot::ok(manager.unload("dmp", [&](std::shared_ptr<const LoadedMotion> it) {
    watched = it;
    seen = it->id;
    EXPECT_EQ(manager.motion("dmp"), nullptr);  // it can no longer be found
    EXPECT_FALSE(manager.load("dmp", "coglab/DmpController").success);
  })));
  EXPECT_EQ(seen, "dmp");
  EXPECT_TRUE(watched.expired());
  EXPECT_EQ(loaded(manager), std::vector<std::string>{"ptp"});
  EXPECT_EQ(manager.unload("dmp").code, ReasonCode::UnknownName);
  std::string type;
  EXPECT_EQ(manager.switchTo("dmp", type).code, ReasonCode::UnknownName);
  EXPECT_TRUE(VirtualRobot::ok(manager.load("dmp", "coglab/DmpController")));
  robot.tick();
}

TEST(Unload, TheActiveOneIsRefusedAndGoesOn) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  ASSERT_TRUE(robot.ptp().add({kThere, {}, {}}).success);
  for (int i = 0; i < 50; ++i) robot.tick();
  const Answer answer = robot.manager->unload("ptp");
  EXPECT_TRUE(refused(answer, {"active", "switch_controller"}));
  EXPECT_EQ(answer.code, ReasonCode::Busy);
  for (int i = 0; i < 50; ++i) robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Running);
  robot.switchTo("");
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->unload("ptp")));
  for (int i = 0; i < 50; ++i) robot.tick();
}

TEST(Unload, AFeedbackControllerGoesByTheSameName) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->load("limits", "JointLimits")));
  ASSERT_TRUE(robot.manager->feedback().disable("limits", true).ok());
  robot.tick();
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->unload("limits")));
  EXPECT_EQ(loaded(*robot.manager), (std::vector<std::string>{"dmp", "ptp"}));
}

TEST(Unload, WhileACancelWaitsForIt) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const CancelOrder order = robot.manager->askCancel("dmp", "");
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->unload("dmp")));
  for (int i = 0; i < 5; ++i) robot.tick();
  CancelAnswer answer;
  EXPECT_TRUE(robot.manager->cancelEnded(order, answer));
  EXPECT_FALSE(answer.was_running);
}

TEST(Unload, RepeatedlyWhileTheCycleRunsAndOtherRequestsArrive) {
  VirtualRobot robot("plan_timeout: 30.0", 0.005, false);
  std::atomic<bool> stop{false};
  std::thread control([&] {
    while (!stop) {
      robot.tick();
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  });
  ControllerManager& manager = *robot.manager;
  std::thread others([&] {
    while (!stop) {
      manager.cancel("other", 0.05, "");
      std::string type;
      manager.switchTo("other", type);
      manager.switchTo("", type);
    }
  });
  int done = 0;
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(VirtualRobot::ok(manager.load("other", "coglab/PtpController")));
    Answer answer;
    // The other threads keep it busy while this thread is not scheduled.
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < end) {
      answer = manager.unload("other");
      if (answer.success) break;
      EXPECT_EQ(answer.code, ReasonCode::Busy) << answer.message;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    done += answer.success ? 1 : 0;
    if (!answer.success) break;
  }
  EXPECT_EQ(done, 40);
  stop = true;
  others.join();
  control.join();
}

TEST(Deactivate, EndsTheMotionBrakesAndStands) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  robot.followWithinLimits();
  ASSERT_TRUE(robot.ptp().add({kThere, {}, {}}).success);
  for (int i = 0; i < 100; ++i) robot.tick();
  ASSERT_GT(robot.sample.velocity.norm(), 0.05);
  std::string type = "?", id = "?";
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->switchTo("", type)));
  EXPECT_EQ(type, "");
  for (int i = 0; i < 200; ++i) robot.tick();
  robot.manager->active(id, type);
  EXPECT_EQ(id, "");
  EXPECT_EQ(type, "");
  const CycleReport report = robot.manager->report();
  EXPECT_TRUE(report.standing);
  EXPECT_EQ(report.state, ManagerState::Idle);
  EXPECT_TRUE(report.active.empty());
  EndedMotion end;
  ASSERT_TRUE(robot.ptp().readEnd(end));
  EXPECT_FALSE(end.executed);
  EXPECT_EQ(end.reason.code(), ReasonCode::Switched);
  const MotionAnswer answer = robot.ptp().add({kThere, {}, {}});
  EXPECT_EQ(answer.code, ReasonCode::NotActive);
  EXPECT_NE(answer.message.find("active is none"), std::string::npos) << answer.message;
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->switchTo("", type)));  // again: no effect
  robot.switchTo("ptp");
  EXPECT_TRUE(robot.ptp().add({kThere, {}, {}}).success);
}

TEST(Deactivate, ClearsAFault) {
  VirtualRobot robot("{" + kTypes + ", odd: {fault: throw, after: 0}}");
  robot.loadBoth("ptp");
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->load("odd", "test/Misbehaving")));
  robot.switchTo("odd");
  for (int i = 0; i < 10; ++i) robot.tick();
  ASSERT_TRUE(robot.manager->report().fault);
  robot.switchTo("");
  robot.tick();
  EXPECT_FALSE(robot.manager->report().fault);
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->unload("odd")));
}

/// Stays in start() until the test releases it.
class Lingering : public MotionController {
 public:
  static inline std::atomic<bool> lingers{false};

  void configure(const MotionSetup&) override {}
  void adopt(const CycleInput&) override {}
  void start(const CycleInput&) override {
    while (lingers) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  void stop() override {}
  void abort(const Reason&) override {}
  void computeReference(const CycleInput&, References&) override {}
  void resolve(const CycleInput&, References&) override {}
  MotionState state() const override { return MotionState::Idle; }
  const Reason& reason() const override { return none_; }

 private:
  Reason none_;
};

TEST(Unload, RefusesBothTheRunningAndTheRequestedController) {
  VirtualRobot robot("", 0.005, false);
  ControllerManager& manager = *robot.manager;
  std::atomic<bool> stop{false};
  std::thread control([&] {
    while (!stop) {
      robot.tick();
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  });
  robot.loadBoth("ptp");
  EXPECT_TRUE(VirtualRobot::ok(manager.load("slow", "test/Lingering")));
  Lingering::lingers = true;
  std::string type, id;
  const Answer taken = manager.switchTo("slow", type);
  EXPECT_TRUE(VirtualRobot::ok(taken));
  for (const std::string words : {"did not confirm", "2.000000 s", "'ptp'"}) {
    EXPECT_NE(taken.message.find(words), std::string::npos) << taken.message;
  }
  manager.active(id, type);
  EXPECT_EQ(id, "slow");
  EXPECT_EQ(manager.report().active.str(), "ptp");
  EXPECT_EQ(manager.unload("ptp").code, ReasonCode::Busy);
  EXPECT_EQ(manager.unload("slow").code, ReasonCode::Busy);
  Lingering::lingers = false;
  for (int i = 0; i < 5000 && manager.report().active.str() != "slow"; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_TRUE(VirtualRobot::ok(manager.unload("ptp")));
  EXPECT_TRUE(refused(manager.unload("slow"), {"'slow'", "switch_controller"}));
  stop = true;
  control.join();
}

}  // namespace
}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER("test/Lingering", coglab_controllers::Lingering)
