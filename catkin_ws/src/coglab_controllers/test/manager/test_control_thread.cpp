// Time of the control thread, which follows the controller's counter while measurements are lost;
// and the cycle with a controller that keeps pushing against a limit.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <sstream>
#include <thread>
#include <tuple>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::atomic<int> extra_ms{0};  // additional duration of Timer

/// Adds up the dt of its cycles.
class Timer : public ctrl_more::FeedbackController {
 public:
  explicit Timer(std::atomic<std::int64_t>& passed_ns) : passed_ns_(passed_ns) {}
  ctrl_more::Description describe() const override {
    ctrl_more::Description description;
    description.type = "Timer";
    description.summary = "adds up the time of its cycles";
    description.modifies(ctrl_more::ControlContainer::TaskSpaceReferencePose, "ee")
        .in("m, quaternion x y z w")
        .frameOf("base")
        .about("left as it is");
    return description;
  }
  void initialize(ctrl_more::Setup&) override {}
  void update(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates&) override {
    passed_ns_ += std::llround(1e9 * cycle.dt);
    if (extra_ms > 0) std::this_thread::sleep_for(std::chrono::milliseconds(extra_ms));
  }

 private:
  std::atomic<std::int64_t>& passed_ns_;
};

/// The robot side of the thread in lockstep with it: one measurement, then the cycle that it
/// causes.
class Robot {
 public:
  explicit Robot(coglab_rt::ArmMailboxes& mailboxes) : mailboxes_(mailboxes) {
    sample_.position = kHome;
    sample_.commanded_position = sample_.position;
    sample_.block = coglab_rt::MotionBlock::None;
  }
  /// A measurement `cycles` of the controller after the last one, without a wake-up.
  void publish(ControllerManager& manager, int cycles) {
    ++sample_.sequence;
    sample_.cycle_time = 1e-9 * static_cast<double>(period_ns);
    sample_.controller_ns += cycles * period_ns;
    sample_.stamp_ns = manager.now_ns();
    mailboxes_.publishSample(sample_);
  }
  /// The same with a wake-up. Returns true if a control cycle followed.
  bool measure(ControllerManager& manager, ControlThread& thread, int cycles) {
    const int before = cycles_run;
    publish(manager, cycles);
    thread.wake(true);
    for (int i = 0; i < 5000 && cycles_run == before; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return cycles_run > before;
  }
  std::int64_t period_ns = 5'000'000;
  std::atomic<int> cycles_run{0};

 private:
  coglab_rt::ArmMailboxes& mailboxes_;
  RobotSample sample_;
};

class ControlThreadTest : public ::testing::Test {
 protected:
  void SetUp() override { prepare("{overrun_time: 0.0}"); }
  void prepare(const std::string& parameters) {
    manager = makeManager(parameters);
    options.priority = 0;
    options.after_cycle = [this](const VelocityCommand&) { ++robot.cycles_run; };
    ctrl_more::ControllerEntry entry;
    entry.blend_s = 0.0;
    ASSERT_TRUE(
        manager->feedback().addController(std::make_unique<Timer>(passed_ns), "timer", entry).ok());
    ASSERT_TRUE(manager->feedback().setProfile("dmp", {"timer"}).ok());
  }
  /// Starts the thread and a controller, which adds up the time of the cycles.
  void start() {
    thread = std::make_unique<ControlThread>(manager->cycle(), mailboxes, options);
    thread->start();
    std::string type;
    ASSERT_TRUE(VirtualRobot::ok(manager->load("dmp", "coglab/DmpController")));
    ASSERT_TRUE(VirtualRobot::ok(manager->switchTo("dmp", type)));
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(robot.measure(*manager, *thread, 1));
    passed_ns = 0;
  }
  void TearDown() override {
    if (thread) thread->stop();
  }
  std::unique_ptr<ControllerManager> makeManager(const std::string& parameters) {
    const coglab_rt::JointLimits limits =
        coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
    ManagerSettings settings = readManagerSettings(
        YAML::Load(parameters), readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"),
        limits, false);
    settings.logger = &logger;
    return std::make_unique<ControllerManager>(std::move(settings));
  }

  coglab_rt::ArmMailboxes mailboxes;
  ctrl_more::Logger logger;
  std::atomic<std::int64_t> passed_ns{0};
  std::unique_ptr<ControllerManager> manager;
  Robot robot{mailboxes};
  ControlThreadOptions options;
  std::unique_ptr<ControlThread> thread;
};

TEST_F(ControlThreadTest, TimeContinuesWhileMeasurementsAreLost) {
  start();
  int cycles = 0;
  for (int i = 0; i < 50; ++i) {
    const int apart = i % 5 == 4 ? 6 : 1;  // each fifth time a burst of five is lost
    cycles += apart;
    ASSERT_TRUE(robot.measure(*manager, *thread, apart));
  }
  EXPECT_EQ(passed_ns, cycles * 5'000'000);
}

TEST_F(ControlThreadTest, NoCycleIsLongerThanTheTimeAfterWhichAMeasurementIsTooOld) {
  start();
  const double longest = manager->cycle().settings().sample_timeout;
  ASSERT_TRUE(robot.measure(*manager, *thread, 1000));
  EXPECT_EQ(passed_ns, std::llround(1e9 * longest));
  ASSERT_TRUE(robot.measure(*manager, *thread, 1));
  EXPECT_EQ(passed_ns, std::llround(1e9 * longest) + 5'000'000);
}

TEST_F(ControlThreadTest, ASlowerCycleUsesEveryThirdMeasurement) {
  options.idle_period = 0.5;
  start();
  robot.period_ns = 2'000'000;  // 2.5 of them are a control cycle of 5 ms
  ASSERT_TRUE(robot.measure(*manager, *thread, 1));
  passed_ns = 0;
  const int before = robot.cycles_run;
  for (int round = 1; round <= 4; ++round) {
    robot.publish(*manager, 1);
    thread->wake(true);
    robot.publish(*manager, 1);
    thread->wake(true);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_EQ(robot.cycles_run, before + round - 1);
    ASSERT_TRUE(robot.measure(*manager, *thread, 1));
    EXPECT_EQ(passed_ns, round * 6'000'000);
  }
}

TEST_F(ControlThreadTest, AMeasurementIsUsedOnceAndSilenceWakesNoThread) {
  options.idle_period = 0.5;
  start();
  const int before = robot.cycles_run;
  thread->wake(true);  // nothing new
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(robot.cycles_run, before);
  robot.publish(*manager, 1);
  thread->wake(false);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(robot.cycles_run, before);
  thread->wake(true);
  for (int i = 0; i < 5000 && robot.cycles_run == before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(robot.cycles_run, before + 1);
}

TEST_F(ControlThreadTest, AMeasurementWithoutAWakeUpIsFoundAfterTheIdlePeriod) {
  start();
  const int before = robot.cycles_run;
  robot.publish(*manager, 1);
  for (int i = 0; i < 5000 && robot.cycles_run == before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(robot.cycles_run, before + 1);
  EXPECT_EQ(passed_ns, 5'000'000);
}

/// A controller that always requests the same velocity.
class Pushing : public MotionController {
 public:
  void configure(const MotionSetup&) override {}
  void adopt(const CycleInput& input) override { allowed = input.motion_allowed; }
  void start(const CycleInput&) override {}
  void stop() override {}
  void abort(const Reason& reason) override {
    why = reason;
    doing = MotionState::Aborted;
  }
  void computeReference(const CycleInput&, References&) override { ++computed; }
  void resolve(const CycleInput&, References& references) override {
    references.states.view<kMaxJoints>(references.joint_velocity) = velocity;
  }
  double limitScale() const override { return limit; }
  MotionState state() const override { return doing; }
  const Reason& reason() const override { return why; }

  JointVector velocity = JointVector::Zero();
  MotionState doing = MotionState::Running;
  Reason why;
  double limit = 1.0;
  bool allowed = false;
  int computed = 0;
};

/// A robot on which it is active.
struct PushedRobot : VirtualRobot {
  explicit PushedRobot(const std::string& parameters = "") : VirtualRobot(parameters) {
    EXPECT_TRUE(ok(manager->load("push", "test/Pushing")));
    push = dynamic_cast<Pushing*>(manager->motion("push"));
    switchTo("push");
  }
  CycleReport run(const RobotSample& from, double dt = 0.005) {
    manager->cycle().run(from, dt, command);
    return manager->report();
  }
  Pushing* push = nullptr;
};

TEST(ControlCycle, AJointIsSlowedBeforeItsStopWhereTheArmOrItsSetPointIsFurther) {
  PushedRobot robot;
  const RobotSetup& setup = *robot.manager->settings().robot;
  Guard guard(setup.guard, setup.chain);
  guard.setInterfaceReserve(0.02, 0.003);
  const double speed = guard.speedToStop(0, 0.03), stop = setup.guard.upper_position[0];
  ASSERT_GT(speed, 0.1);
  ASSERT_LT(speed, 0.3);
  for (const double side : {1.0, -1.0}) {
    for (JointVector RobotSample::*further :
         {&RobotSample::position, &RobotSample::commanded_position}) {
      RobotSample sample = robot.sample;
      sample.stop_delay = 0.02;
      sample.stop_rounding = 0.003;
      (sample.*further)[0] = side * (stop - 0.03);
      robot.push->velocity[0] = side;
      robot.run(sample);
      EXPECT_NEAR(robot.command.velocity[0], side * speed, 1e-9);
    }
  }
}

TEST(ControlCycle, ABorderThatReducesTheSpeedToZeroEndsAMotion) {
  PushedRobot robot("workspace: {box_max: [0.7, 1.2, 1.6]}");
  const ChainState home = robot.manager->settings().robot->chain.evaluate(kHome);
  robot.push->velocity = 0.2 * home.jacobian.row(0).transpose().normalized();
  double moved = robot.hand().position.x(), stands = 0.0;
  for (int i = 0; i < 4000 && robot.state() != MotionState::Aborted; ++i) {
    robot.tick();
    const double x = robot.hand().position.x();
    stands = x - moved > 1e-3 ? 0.0 : stands + robot.period;
    if (stands == 0.0) moved = x;
  }
  EXPECT_EQ(robot.push->why.code(), ReasonCode::WorkspaceBorder) << robot.push->why.str();
  EXPECT_NEAR(stands, 0.5, 0.1);
}

TEST(ControlCycle, MotionIsAllowedOnlyWithAUsableJointStateOfAnEnabledArm) {
  PushedRobot robot;
  robot.push->doing = MotionState::Idle;
  RobotSample held = robot.sample, broken = robot.sample;
  held.block = MotionBlock::Held;
  broken.torque[6] = std::nan("");
  int computed = 0;
  for (const auto& [sample, allowed, computes] :
       {std::tuple(robot.sample, true, 1), {held, false, 1}, {broken, false, 0}}) {
    robot.push->allowed = !allowed;
    robot.run(sample);
    EXPECT_EQ(robot.push->allowed, allowed);
    EXPECT_EQ(robot.push->computed, computed += computes);
  }
  robot.push->velocity[6] = 1e-9;  // the arm stands by its set-point, and is asked to go on
  EXPECT_FALSE(robot.run(robot.sample).standing);
  EXPECT_EQ(robot.command.velocity[6], 1e-9);
  robot.push->velocity.setZero();
  EXPECT_FALSE(robot.run(robot.sample).standing) << "that may not have reached the set-point yet";
  EXPECT_TRUE(robot.run(robot.sample).standing);
}

}  // namespace
}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER("test/Pushing", coglab_controllers::Pushing)
