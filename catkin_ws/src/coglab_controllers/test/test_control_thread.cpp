// The control thread's time: it goes on with the controller's counter while measurements are lost.
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::atomic<int> extra_ms{0};  // that Timer takes

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
  /// A measurement `cycles` of the controller after the last one, of which nobody is told.
  void publish(ControllerManager& manager, int cycles) {
    ++sample_.sequence;
    sample_.cycle_time = 1e-9 * static_cast<double>(period_ns);
    sample_.controller_ns += cycles * period_ns;
    sample_.stamp_ns = manager.now_ns();
    mailboxes_.publishSample(sample_);
  }
  /// The same, and the thread is woken. Whether a control cycle followed.
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
  /// Starts the thread and a controller: from then on the time of the cycles is added up.
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

TEST_F(ControlThreadTest, TimeGoesOnWhileMeasurementsAreLost) {
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

TEST_F(ControlThreadTest, ASlowerCycleThanTheArmsTakesEachThirdOfItsMeasurements) {
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

TEST_F(ControlThreadTest, AMeasurementIsTakenOnceAndSilenceWakesNobody) {
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

TEST_F(ControlThreadTest, AMeasurementWhoseWakingWasLostIsFoundAfterTheIdlePeriod) {
  start();
  const int before = robot.cycles_run;
  robot.publish(*manager, 1);
  for (int i = 0; i < 5000 && robot.cycles_run == before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(robot.cycles_run, before + 1);
  EXPECT_EQ(passed_ns, 5'000'000);
}

TEST_F(ControlThreadTest, TheReportSaysHowLongTheCycleTookAndTheLongest) {
  prepare("{overrun_time: 0.5}");
  start();
  extra_ms = 50;
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(robot.measure(*manager, *thread, 1));
  const std::chrono::duration<double> outside = std::chrono::steady_clock::now() - begin;
  extra_ms = 0;
  const CycleReport slow = manager->report();
  EXPECT_GE(slow.duration, 0.05);
  EXPECT_LE(slow.duration, outside.count());
  EXPECT_EQ(slow.longest, slow.duration);
  ASSERT_TRUE(robot.measure(*manager, *thread, 1));
  const CycleReport quick = manager->report();
  EXPECT_GT(quick.duration, 0.0);
  EXPECT_LT(quick.duration, slow.duration);
  EXPECT_EQ(quick.longest, slow.longest);
}

TEST_F(ControlThreadTest, WithoutAPriorityThereIsNothingToWarnOfAndItStopsAtOnce) {
  options.idle_period = 60.0;
  thread = std::make_unique<ControlThread>(manager->cycle(), mailboxes, options);
  EXPECT_EQ(thread->warning(), "");
  thread->start();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(thread->warning(), "");
  const auto begin = std::chrono::steady_clock::now();
  thread->stop();
  thread->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
}

}  // namespace
}  // namespace coglab_controllers
