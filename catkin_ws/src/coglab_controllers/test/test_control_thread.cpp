// The control thread's time: it goes on with the controller's counter while measurements are lost.
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

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
    sample_.cycle_time = 0.005;
    sample_.block = coglab_rt::MotionBlock::None;
  }
  /// A measurement `cycles` of the controller after the last one. Whether a control cycle followed.
  bool measure(ControllerManager& manager, ControlThread& thread, int cycles) {
    const int before = cycles_run;
    ++sample_.sequence;
    sample_.controller_ns += cycles * 5'000'000;
    sample_.stamp_ns = manager.now_ns();
    mailboxes_.publishSample(sample_);
    thread.wake(true);
    for (int i = 0; i < 5000 && cycles_run == before; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return cycles_run > before;
  }
  std::atomic<int> cycles_run{0};

 private:
  coglab_rt::ArmMailboxes& mailboxes_;
  RobotSample sample_;
};

TEST(ControlThread, TimeGoesOnWhileMeasurementsAreLost) {
  coglab_rt::ArmMailboxes mailboxes;
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{overrun_time: 0.0}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  std::atomic<std::int64_t> passed_ns{0};
  ctrl_more::ControllerEntry entry;
  entry.blend_s = 0.0;
  ASSERT_TRUE(
      manager.feedback().addController(std::make_unique<Timer>(passed_ns), "timer", entry).ok());
  ASSERT_TRUE(manager.feedback().setProfile("dmp", {"timer"}).ok());
  Robot robot(mailboxes);
  ControlThreadOptions options;
  options.priority = 0;
  options.after_cycle = [&robot](const VelocityCommand&) { ++robot.cycles_run; };
  ControlThread thread(manager.cycle(), mailboxes, options);
  thread.start();
  std::string type;
  ASSERT_TRUE(VirtualRobot::ok(manager.load("dmp", "coglab/DmpController")));
  ASSERT_TRUE(VirtualRobot::ok(manager.switchTo("dmp", type)));
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(robot.measure(manager, thread, 1));
  passed_ns = 0;
  int cycles = 0;
  for (int i = 0; i < 50; ++i) {
    const int apart = i % 5 == 4 ? 6 : 1;  // each fifth time a burst of five is lost
    cycles += apart;
    ASSERT_TRUE(robot.measure(manager, thread, apart));
  }
  EXPECT_EQ(passed_ns, cycles * 5'000'000);
  thread.stop();
}

}  // namespace
}  // namespace coglab_controllers
