// Functions of the runner for every motion: queue, replacement, arrival, abort, standstill.
#include <limits>
#include <utility>

#include <gtest/gtest.h>

#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {
namespace {

/// Turns one joint with a constant speed for a time; misbehaves on request.
class Turn : public Motion<> {
 public:
  static inline int stops = 0;

  void configure(MotionConfiguration& configuration) override {
    speed_ = configuration.argument("speed", "rad/s", 0.2, -1.0, 1.0);
    duration_ = configuration.argument("duration", "s", 1.0, 0.0, 100.0);
    fault_ = configuration.argument("fault", "", 0.0, 0.0, 9.0);
  }
  void start(const MotionStart<>& start) override {
    if (start.request[fault_] == 1.0) throw std::runtime_error("told to throw");
    request_ = start.request;
    from_ = start.from;
    time_ = 0.0;
  }
  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    time_ = cycle.next;
    if (request_[fault_] == 2.0) return;  // asks for nothing: the arm rests
    reference.joints(at(cycle.time), at(cycle.next));
    if (request_[fault_] == 3.0)
      reference.joint_velocity[2] = std::numeric_limits<double>::quiet_NaN();
  }
  MotionState state() const override {
    if (request_[fault_] == 4.0 && time_ > 0.5) return MotionState::Aborted;
    return time_ >= request_[duration_] ? MotionState::Reached : MotionState::Running;
  }
  const Reason& reason() const override {
    static const Reason none, why(ReasonCode::GoalUnreachable, "told to give up");
    static const Reason wait(ReasonCode::GoalUnreachable, "told to wait");
    if (request_[fault_] == 5.0 && time_ > 0.3 && time_ < 0.6) return wait;
    return request_[fault_] == 4.0 && time_ > 0.5 ? why : none;
  }
  void stop() noexcept override { ++stops; }

 private:
  JointVector at(double time) const {
    JointVector joints = from_.joints;
    joints[0] += request_[speed_] * std::min(time, request_[duration_]);
    return joints;
  }

  ArgumentIndex speed_, duration_, fault_;
  MotionArguments request_;
  SetPoint from_;
  double time_ = 0.0;
};

struct Runner : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "turn: {max_queue: 2, settle_time: 0.5}"};
  CustomMotionController& turn = arm.load("turn", "test/Turn");

  MotionAnswer ask(double speed, double duration, bool queue, double fault = 0.0) {
    return turn.startMotion({{"speed", "duration", "fault"}, {speed, duration, fault}, queue});
  }
  std::vector<EndedMotion> ends() {
    std::vector<EndedMotion> all;
    for (EndedMotion end; turn.readEnd(end);) all.push_back(end);
    return all;
  }
  double joint() const { return arm.sample.position[0]; }
};

TEST_F(Runner, AQueueRunsInOrderFromEachEndAndRefusesWhenFull) {
  const double home = joint();
  EXPECT_EQ(ask(0.2, 1.0, true).status, MotionAnswer::kStarted);
  EXPECT_EQ(ask(0.1, 1.0, true).status, MotionAnswer::kQueued);
  EXPECT_EQ(ask(-0.3, 1.0, true).status, MotionAnswer::kQueued);
  const MotionAnswer full = ask(0.1, 1.0, true);
  EXPECT_EQ(full.status, MotionAnswer::kRejected);
  EXPECT_EQ(full.code, ReasonCode::QueueFull);
  EXPECT_EQ(full.id, -1);
  EXPECT_NE(full.message.find("max_queue 2"), std::string::npos) << full.message;
  arm.run(1.0);
  EXPECT_NEAR(joint() - home, 0.2, 0.01);
  arm.run(1.0);
  EXPECT_NEAR(joint() - home, 0.3, 0.01);
  arm.run(1.5);
  EXPECT_NEAR(joint() - home, 0.0, 0.01);
  EXPECT_EQ(arm.state(), MotionState::Reached);
  const std::vector<EndedMotion> all = ends();
  ASSERT_EQ(all.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(all[i].executed && all[i].id == i);
  EXPECT_EQ(ask(0.1, 1.0, true).id, 3) << "what was refused has no id";
}

TEST_F(Runner, NewMotionReplacesTheRunningOneWithoutAStep) {
  ask(0.3, 2.0, false);
  ask(0.3, 2.0, true);
  arm.run(1.0);
  const JointVector before = arm.sample.position;
  EXPECT_EQ(ask(0.3, 1.0, false).status, MotionAnswer::kStarted);
  arm.tick();
  EXPECT_NEAR(arm.sample.position[0] - before[0], 0.3 * arm.period, 1e-6);
  EXPECT_EQ(arm.state(), MotionState::Running);
  const std::vector<EndedMotion> all = ends();
  ASSERT_EQ(all.size(), 2u);  // what ran and what waited
  for (const EndedMotion& end : all) {
    EXPECT_FALSE(end.executed);
    EXPECT_EQ(end.reason.code(), ReasonCode::Superseded);
  }
}

TEST_F(Runner, AnAbortEndsTheMotionAndTheQueueAndTheArmStands) {
  arm.followWithinLimits();
  Turn::stops = 0;
  ask(0.3, 5.0, true);
  ask(0.3, 5.0, true);
  arm.run(1.0);
  arm.manager->askCancel("turn", "test");
  arm.run(1.0);
  EXPECT_EQ(Turn::stops, 1);
  const CycleReport report = arm.manager->report();
  EXPECT_TRUE(report.standing);
  EXPECT_EQ(report.motion, MotionState::Aborted);
  EXPECT_EQ(report.reason.code(), ReasonCode::Cancelled);
  EXPECT_NE(report.reason.str().find("not executed: motion_id 0, 1"), std::string::npos)
      << report.reason.str();
  EXPECT_EQ(ends().size(), 2u);
  EXPECT_EQ(ask(0.1, 1.0, true).status, MotionAnswer::kStarted);  // and on it goes
}

TEST_F(Runner, AMotionReplacedBeforeItsStartIsAlsoReported) {
  EXPECT_EQ(ask(0.2, 1.0, false).id, 0);
  EXPECT_EQ(ask(0.2, 1.0, true).status, MotionAnswer::kQueued);
  EXPECT_EQ(ask(-0.2, 1.0, false).id, 2);
  const std::vector<EndedMotion> all = ends();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].id, 0);
  EXPECT_EQ(all[1].id, 1);
  arm.run(1.5);
  EXPECT_LT(joint(), kHome[0] - 0.15) << "the newest one";
  ASSERT_EQ(ends().size(), 1u);
}

TEST_F(Runner, AfterASwitchAReachedMotionBecomesIdle) {
  ask(0.1, 0.2, false);
  arm.run(1.0);
  ASSERT_EQ(arm.state(), MotionState::Reached);
  std::string type;
  ASSERT_TRUE(arm.manager->switchTo("", type).success);
  MotionProgress progress;
  ASSERT_TRUE(turn.readProgress(progress));
  EXPECT_EQ(progress.state, MotionState::Idle);
}

TEST_F(Runner, FaultsOfAMotionEndInStandStillWithTheReason) {
  EXPECT_TRUE(ask(0.2, 1.0, false, 4.0).success);
  arm.run(1.0);
  EXPECT_EQ(arm.state(), MotionState::Aborted);
  EXPECT_EQ(arm.manager->report().reason.code(), ReasonCode::GoalUnreachable);
  EXPECT_TRUE(ask(0.2, 1.0, false, 2.0).success);
  arm.run(0.5);
  EXPECT_EQ(arm.command.velocity, JointVector::Zero().eval());
  for (const double fault : {1.0, 3.0}) {
    std::string type;
    ASSERT_TRUE(arm.manager->switchTo("turn", type).success);
    EXPECT_TRUE(ask(0.2, 1.0, false, fault).success);
    arm.run(0.1);
    EXPECT_EQ(arm.command.velocity, JointVector::Zero().eval());
    EXPECT_EQ(arm.manager->report().reason.code(), ReasonCode::ControllerFault) << arm.reason();
  }
}

}  // namespace
}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION("test/Turn", coglab_controllers::Turn)
