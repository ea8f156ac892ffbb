// The control cycle neither allocates nor locks nor enters the kernel: 10^5 free-running cycles
// with 100 controllers, while another thread publishes plans, reorders, reloads gains and queries.
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <iostream>
#include <mutex>
#include <random>
#include <sstream>
#include <thread>

#include "forbidden_calls.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(ForbiddenCalls, AreSeen) {
  forbidden::start();
  std::vector<double> memory(100);
  std::mutex mutex;
  { const std::lock_guard<std::mutex> lock(mutex); }
  try {
    throw std::runtime_error("x");
  } catch (const std::exception&) {
  }
  sched_yield();
  const forbidden::Counts counts = forbidden::stop();
  EXPECT_GE(counts.allocations, 1u);
  EXPECT_EQ(counts.locks, 1u);
  EXPECT_EQ(counts.syscalls, 1u);
  EXPECT_GE(counts.of_throw, 1u);
}

// Reads an IMU, turns a pose, shifts a velocity; with every bound judged and a log record at times.
std::unique_ptr<TestController> typical(std::atomic<bool>* throw_now) {
  auto c = std::make_unique<TestController>();
  c->description.measured("imu").size(9).in("rad").frameOf("imu").maxAge(1.0);
  c->description.modifies(ControlContainer::TaskSpaceReferencePose, "ee")
      .bounded({10, 1e6, 1, 1e6});
  c->description.modifies(ControlContainer::TaskSpaceReferenceVel, "ee");
  c->description.gain("kp", 0.01).range(0, 1).in("1").about("x");
  c->on_initialize = [](TestController& self, ctrl_more::Setup& setup) {
    self.in = setup.read("imu");
    self.out = setup.modify("taskSpaceReferencePose/ee");
    self.gain_handle = setup.gain("kp");
  };
  c->on_update = [throw_now](TestController& self, const Cycle& cycle, const RobotStates& robot,
                             const ControlStates&, ModifiedControlStates& modified) {
    modified[self.out][0] += self.scalar(self.gain_handle) * robot.view(self.in)[3];
    if (cycle.number % 1000 == 0) CTRL_MORE_LOG(self.log(), Info, "cycle {}", cycle.number);
    if (throw_now && throw_now->exchange(false)) throw std::runtime_error("on purpose");
  };
  return c;
}

// Requests of another thread while the cycles run.
Status change(FeedbackControllersManager& manager, int kind, const std::string& name,
              const std::string& gains, std::mt19937& random) {
  switch (kind) {
    case 0:
      return manager.disable(name);
    case 1:
      return manager.enable();
    case 2:
      return manager.pause(name);
    case 3:
      return manager.resume();
    case 4: {
      std::vector<std::string> order = manager.getExecutionOrder();
      std::swap(order[random() % order.size()], order[random() % order.size()]);
      return manager.setExecutionOrder(order);
    }
    case 5:
      return manager.loadGains(name, gains);
    case 6:
      return manager.pauseAllUsingRobotState("imu");
    default:
      return manager.resumeAllUsingRobotState("imu");
  }
}

// Runs cycles as fast as possible. Returns the counts of forbidden calls.
forbidden::Counts cycleWhile(const std::atomic<bool>& run, std::atomic<std::uint64_t>& cycles,
                             Rig& rig) {
  const RobotSignal imu = rig.robot.find(RobotSource::Measured, "imu");
  const ControlStates references = rig.control;
  const double values[9] = {0.1, 0, 0, 0.1, 0, 0, 0, 0, 9.81};
  Cycle cycle{0, 0.005, 0};
  forbidden::start();
  while (run.load(std::memory_order_relaxed)) {
    ++cycle.number;
    cycle.now_ns += 5000000;
    rig.control.copyValuesFrom(references);
    rig.robot.write(imu, values, cycle.now_ns);
    rig.manager->beginCycle(cycle);
    rig.manager->updateStage(Stage::Task, rig.robot, rig.control);
    rig.manager->updateStage(Stage::Joint, rig.robot, rig.control);
    rig.manager->endCycle();
    cycles.store(cycle.number, std::memory_order_relaxed);
  }
  return forbidden::stop();
}

TEST(Realtime, NothingForbiddenIn100000CyclesWith10000PlanChanges) {
  Rig rig(0.05, true, true);
  std::atomic<bool> throw_now{false};
  constexpr int kControllers = 100;
  std::vector<std::string> names;
  for (int i = 0; i < kControllers; ++i) {
    names.push_back("c" + std::to_string(i));
    rig.add(typical(i == 50 ? &throw_now : nullptr), names.back());
  }
  const std::string gains = ::testing::TempDir() + "/ctrl_more_realtime.yaml";
  std::ofstream(gains) << "kp: 0.02\n";
  rig.robot.setMeasuredData("imu", Eigen::VectorXd::Constant(9, 0.1), 0);
  rig.setReferences();
  rig.manager->freeze();

  std::atomic<bool> run{true};
  std::atomic<std::uint64_t> cycles{0};
  forbidden::Counts counts;
  std::thread cycle_thread([&] { counts = cycleWhile(run, cycles, rig); });

  std::mt19937 random(1);
  std::uint64_t adopted = 0, reorders = 0, reloads = 0, faults = 0;
  int changes = 0;
  while (cycles.load() < 100000 || adopted < 10000) {
    const std::string& name = names[random() % names.size()];
    const int kind = static_cast<int>(random() % 8);
    const Status status = change(*rig.manager, kind, name, gains, random);
    ASSERT_TRUE(status) << status.message();
    if (rig.manager->waitAdopted(status.generation(), 1.0)) {
      ++adopted;
      reorders += kind == 4;
      reloads += kind == 5;
    }
    if (++changes % 500 == 0) {
      throw_now = true;
      rig.manager->enable("c50");
      rig.manager->resume("c50");
    } else if (changes % 500 == 250) {
      faults = std::max(faults, rig.manager->status("c50").faults);
      rig.manager->resume("c50", "fault");
    }
    if (changes % 97 == 0) rig.manager->attribution();
    if (changes % 89 == 0) rig.logger.drain();
  }
  run = false;
  cycle_thread.join();
  std::cout << "cycles " << cycles << ", plans adopted " << adopted << ", reorders " << reorders
            << ", reloads " << reloads << ", faults " << faults << ", allocations "
            << counts.allocations << ", locks " << counts.locks << ", syscalls " << counts.syscalls
            << ", allocations of throws " << counts.of_throw << "\n";
  EXPECT_EQ(counts.allocations, 0u);
  EXPECT_EQ(counts.locks, 0u);
  EXPECT_EQ(counts.syscalls, 0u);
  EXPECT_GE(cycles.load(), 100000u);
  EXPECT_GE(adopted, 10000u);
  EXPECT_GE(reorders, 100u);
  EXPECT_GE(reloads, 100u);
  EXPECT_GE(faults, 1u) << "a fault was among them";
}

// Check by the kernel: in strict seccomp mode any system call except read, write and exit kills the
// process. Reading the clock is forbidden too, so the cycles are not timed and log no records.
TEST(Realtime, CyclesRunWhereSystemCallsKill) {
  Rig rig(0.05, false, true);
  rig.logger.setLevel(LogLevel::Error);
  for (int i = 0; i < 10; ++i) rig.add(typical(nullptr), "c" + std::to_string(i));
  rig.robot.setMeasuredData("imu", Eigen::VectorXd::Constant(9, 0.1), 0);
  rig.step(2);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, 1 /* SECCOMP_MODE_STRICT */) != 0) _exit(77);
    const ControlStates& references = rig.control;
    for (int i = 0; i < 20000; ++i) {
      ++rig.cycle.number;
      rig.control.copyValuesFrom(references);
      rig.manager->update(rig.cycle, rig.robot, rig.control);
    }
    // _exit() is exit_group, which strict mode forbids too; exit of the thread is allowed.
    __asm__ volatile("syscall" : : "a"(60), "D"(0) : "rcx", "r11", "memory");
  }
  int state = 0;
  ASSERT_EQ(waitpid(child, &state, 0), child);
  if (WIFEXITED(state) && WEXITSTATUS(state) == 77) GTEST_SKIP() << "no seccomp here";
  EXPECT_TRUE(WIFEXITED(state) && WEXITSTATUS(state) == 0)
      << (WIFSIGNALED(state) ? "killed: a system call was made" : "failed");
}

}  // namespace
}  // namespace ctrl_more
