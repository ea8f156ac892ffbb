// A cancel brakes within the limits, ends the queue, and no motion starts later.
#include <atomic>
#include <chrono>
#include <random>
#include <thread>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::vector<EndedMotion> endsOf(PtpController& ptp) {
  std::vector<EndedMotion> ends;
  for (EndedMotion end; ptp.readEnd(end);) ends.push_back(end);
  return ends;
}

/// Ticks until the cancel has ended; number of cycles, -1 if it has not after `most`.
int finish(VirtualRobot& robot, const CancelOrder& order, CancelAnswer& answer, int most = 400) {
  for (int cycles = 0; cycles <= most; ++cycles) {
    if (robot.manager->cancelEnded(order, answer)) return cycles;
    robot.tick();
  }
  return -1;
}

/// Smallest number of cycles for braking from the set-point's present state.
int brakingCycles(const VirtualRobot& robot) {
  double longest = 0.0;
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const coglab_rt::AxisState axis = robot.interpolator->axis(joint);
    longest = std::max(
        longest, coglab_rt::planVelocity(axis.velocity, axis.acceleration, 0.0,
                                         robot.limits.acceleration[joint], robot.limits.jerk[joint])
                     .totalTime());
  }
  return static_cast<int>(std::ceil(longest / robot.period - 1e-9));
}

TEST(Cancel, EndsTheMotionAndItsQueueWithAReason) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  robot.followWithinLimits();
  std::vector<int> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(robot.ptp().add({kThere, {}, {}}).id);
  for (int i = 0; i < 100; ++i) robot.tick();
  ASSERT_GT(robot.command.velocity.norm(), 0.05);
  EXPECT_FALSE(robot.manager->report().standing);
  CancelAnswer answer;
  const std::string why = "the state machine gives up";
  const CancelOrder order = robot.manager->askCancel("ptp", why);
  EXPECT_FALSE(robot.manager->cancelEnded(order, answer));
  ASSERT_GE(finish(robot, order, answer), 0);
  EXPECT_TRUE(answer.success);
  EXPECT_TRUE(answer.was_running);
  EXPECT_EQ(answer.code, ReasonCode::None);
  const CycleReport report = robot.manager->report();
  EXPECT_TRUE(report.standing);
  EXPECT_EQ(report.state, ManagerState::Idle);
  EXPECT_EQ(report.reason.code(), ReasonCode::Cancelled);
  EXPECT_NE(report.reason.str().find(why), std::string::npos);
  const std::vector<EndedMotion> ends = endsOf(robot.ptp());
  ASSERT_EQ(ends.size(), ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(ends[i].id, ids[i]);
    EXPECT_FALSE(ends[i].executed);
    EXPECT_EQ(ends[i].reason.code(), ReasonCode::Cancelled);
  }
  const JointVector stood = robot.sample.position;
  for (int i = 0; i < 200; ++i) robot.tick();
  EXPECT_EQ(robot.sample.position, stood);
  // A request after a cancel is executed.
  const MotionAnswer next = robot.ptp().add({kThere, {}, {}});
  ASSERT_EQ(next.status, MotionAnswer::kStarted) << next.message;
  for (int i = 0; i < 2000 && robot.state() != MotionState::Reached; ++i) robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Reached);
}

TEST(Cancel, EndsADmpMotionAndOneThatFollowsItsGoal) {
  VirtualRobot robot;
  robot.loadBoth("dmp");
  robot.followWithinLimits();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  const auto ticks = [&](int count) {
    for (int i = 0; i < count; ++i) {
      robot.see("human_hand", kGoal);
      robot.tick();
    }
  };
  ticks(100);
  CancelAnswer answer;
  ASSERT_GE(finish(robot, robot.manager->askCancel("dmp", ""), answer), 0);
  EXPECT_TRUE(answer.success && answer.was_running);
  DmpProgress progress;
  robot.dmp().readProgress(progress);
  EXPECT_EQ(progress.state, MotionState::Aborted);
  EXPECT_EQ(progress.reason.code(), ReasonCode::Cancelled);
  EXPECT_EQ(robot.dmp().switchDmp(robot.reach("give_human")).code, ReasonCode::NothingRuns);

  // A motion that has reached its goal follows it when it moves away; a cancel ends that too.
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 3000 && robot.state() != MotionState::Reached; ++i) ticks(1);
  ASSERT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  ASSERT_GE(finish(robot, robot.manager->askCancel("dmp", ""), answer), 0);
  const JointVector stood = robot.sample.position;
  for (int i = 0; i < 300; ++i) {
    robot.see("human_hand", kGoal + Vector3(0.0, 0.1, 0.0));
    robot.tick();
  }
  EXPECT_EQ(robot.sample.position, stood);
}

TEST(Cancel, ARequestThatWasMadeBeforeItNeverMovesTheArm) {
  for (const std::string active : {"ptp", "dmp"}) {
    VirtualRobot robot;
    robot.loadBoth(active);
    robot.followWithinLimits();
    robot.see("human_hand", kGoal);
    const JointVector stood = robot.sample.position;
    // Another request is running; this one is waiting when the cancel arrives.
    auto lock = robot.manager->lockRequests();
    std::atomic<int> code{-1};
    std::thread request([&] {
      code = static_cast<int>(active == "ptp" ? robot.ptp().add({kThere, {}, {}}).code
                                              : robot.dmp().execute(robot.reach()).code);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const CancelOrder order = robot.manager->askCancel(active, "");
    lock.unlock();
    request.join();
    EXPECT_EQ(code, static_cast<int>(ReasonCode::Cancelled));
    CancelAnswer answer;
    ASSERT_GE(finish(robot, order, answer), 0);
    EXPECT_TRUE(answer.success);
    EXPECT_FALSE(answer.was_running);
    for (int i = 0; i < 100; ++i) robot.tick();
    EXPECT_EQ(robot.sample.position, stood);
  }
}

TEST(Cancel, AMotionThatHasNotBegunIsEndedToo) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const MotionAnswer pending = robot.ptp().add({kThere, {}, {}});  // adopted without a joint state
  ASSERT_EQ(pending.status, MotionAnswer::kStarted);
  const JointVector stood = robot.sample.position;
  const CancelOrder order = robot.manager->askCancel("ptp", "");
  CancelAnswer answer;
  ASSERT_GE(finish(robot, order, answer), 0);
  EXPECT_TRUE(answer.success && answer.was_running);
  for (int i = 0; i < 100; ++i) robot.tick();
  EXPECT_EQ(robot.sample.position, stood);
  const std::vector<EndedMotion> ends = endsOf(robot.ptp());
  ASSERT_EQ(ends.size(), 1u);
  EXPECT_EQ(ends[0].reason.code(), ReasonCode::Cancelled);
}

TEST(Cancel, WorksWhileMotionIsBlockedAndNamesAnotherMovingController) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  CancelAnswer answer;
  EXPECT_GE(finish(robot, robot.manager->askCancel("dmp", ""), answer), 0);  // is not active
  EXPECT_TRUE(answer.success);
  ASSERT_EQ(robot.ptp().add({kThere, {}, {}}).status, MotionAnswer::kStarted);
  for (int i = 0; i < 50; ++i) robot.tick();
  EXPECT_GE(finish(robot, robot.manager->askCancel("dmp", ""), answer), 0);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.code, ReasonCode::NotActive);
  EXPECT_EQ(robot.state(), MotionState::Running);
  robot.sample.block = coglab_rt::MotionBlock::Held;
  ++robot.sample.motion_epoch;
  for (int i = 0; i < 5; ++i) robot.tick();
  EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::Held);
  EXPECT_GE(finish(robot, robot.manager->askCancel("ptp", ""), answer), 0);
  EXPECT_TRUE(answer.success);
  EXPECT_FALSE(answer.was_running);
  EXPECT_GE(finish(robot, robot.manager->askCancel("nobody", ""), answer), 0);
  EXPECT_EQ(answer.code, ReasonCode::UnknownName);
}

TEST(Cancel, TheArmStandsWithinTheBrakingTimeAndDoesNotMoveAfterwards) {
  std::mt19937 random(3);
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  VirtualRobot robot;
  robot.loadBoth("ptp");
  robot.followWithinLimits();
  int ended = 0;
  for (int run = 0; run < 120; ++run) {
    const std::string id = run % 2 == 0 ? "ptp" : "dmp";
    robot.switchTo(id);
    std::vector<double> target(7);
    for (double& q : target) q = uniform(-1.2, 1.2);
    robot.see("human_hand", kGoal + Vector3(uniform(-0.2, 0.0), uniform(-0.3, 0.3), 0.1));
    if (id == "ptp") {
      robot.ptp().add({target, std::vector<double>(7, uniform(0.2, 1.9)), {}});
    } else {
      DmpRequest request = robot.reach();
      request.dmp_ratio = uniform(0.8, 2.0);
      robot.dmp().execute(request);
    }
    const int before = static_cast<int>(uniform(0.0, 250.0));
    for (int i = 0; i < before; ++i) {
      robot.frames.frames["human_hand"].stamp_ns = robot.now_ns;
      robot.tick();
    }
    const CancelOrder order = robot.manager->askCancel(id, "");
    robot.tick();  // this cycle adopts it; the velocity of the last cycle still acts
    const int best = brakingCycles(robot);
    CancelAnswer answer;
    const int cycles = finish(robot, order, answer);
    ASSERT_GE(cycles, 0) << id << " after " << before << " cycles";
    EXPECT_TRUE(answer.success);
    EXPECT_LE(cycles, best + 2) << id << " after " << before << " cycles";
    ended += answer.was_running ? 1 : 0;
    const JointVector stood = robot.sample.position;
    for (int i = 0; i < 10; ++i) robot.tick();
    ASSERT_EQ(robot.sample.position, stood);
  }
  EXPECT_GT(ended, 60);
}

// An arm on the real clock until `stop`. While it is blind it sends no measurements.
void runArm(ControllerManager& manager, ControlThread& thread, coglab_rt::ArmMailboxes& mailboxes,
            const coglab_rt::JointLimits& limits, const std::atomic<bool>& stop,
            const std::atomic<bool>& blind) {
  coglab_rt::Interpolator interpolator(limits);
  RobotSample sample;
  sample.position = kHome;
  interpolator.reset(sample.position);
  sample.cycle_time = 0.005;
  sample.block = coglab_rt::MotionBlock::None;
  VelocityCommand command;
  while (!stop) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    if (blind) continue;
    mailboxes.takeVelocity(command);
    interpolator.step(command.velocity, 0.005);
    sample.position = sample.commanded_position = interpolator.position();
    sample.velocity = sample.commanded_velocity = interpolator.velocity();
    sample.commanded_acceleration = interpolator.acceleration();
    ++sample.sequence;
    sample.stamp_ns = manager.now_ns();
    sample.controller_ns += 5'000'000;
    mailboxes.publishSample(sample);
    thread.wake(true);
  }
}

// Waits until the arm moves; false if it does not within 5 s.
bool moves(ControllerManager& manager) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (std::chrono::steady_clock::now() < end) {
    if (manager.report().robot.commanded_velocity.norm() > 0.05) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return false;
}

TEST(Cancel, OnTheRealClockReturnsAtRestOrAtItsTimeLimit) {
  coglab_rt::ArmMailboxes mailboxes;
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Node(), readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  settings.logger = &logger;
  settings.cycle.overrun_time = 0.0;
  settings.cycle.sample_timeout = 1.0;
  settings.cycle.silent_time = 1.0;
  ControllerManager manager(std::move(settings));
  ControlThreadOptions options;
  options.priority = 0;
  ControlThread thread(manager.cycle(), mailboxes, options);
  thread.start();
  std::string type;
  ASSERT_TRUE(VirtualRobot::ok(manager.load("ptp", "coglab/PtpController")));
  ASSERT_TRUE(VirtualRobot::ok(manager.switchTo("ptp", type)));
  std::atomic<bool> stop{false}, blind{false};
  std::thread robot([&] { runArm(manager, thread, mailboxes, limits, stop, blind); });
  auto& ptp = dynamic_cast<PtpController&>(*manager.motion("ptp"));
  while (manager.report().samples == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  ASSERT_EQ(ptp.add({kThere, {}, {}}).status, MotionAnswer::kStarted);
  ASSERT_TRUE(moves(manager));
  const CancelAnswer good = manager.cancel("ptp", 5.0, "test");
  EXPECT_TRUE(good.success) << good.message;
  EXPECT_TRUE(good.was_running);
  EXPECT_TRUE(manager.report().robot.commanded_velocity.isZero(0.0));

  ASSERT_EQ(ptp.add({kThere, {}, {}}).status, MotionAnswer::kStarted);
  ASSERT_TRUE(moves(manager));
  blind = true;  // measurements stop, so it is unknown whether the arm stands
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const CancelAnswer bad = manager.cancel("ptp", 0.2, "test");
  EXPECT_FALSE(bad.success);
  EXPECT_TRUE(bad.was_running);
  EXPECT_NE(bad.code, ReasonCode::None) << bad.message;
  stop = true;
  robot.join();
  thread.stop();
  const CancelAnswer dead = manager.cancel("ptp", 0.05, "test");
  EXPECT_FALSE(dead.success);
  EXPECT_EQ(dead.code, ReasonCode::NotAdopted) << dead.message;
}

}  // namespace
}  // namespace coglab_controllers
