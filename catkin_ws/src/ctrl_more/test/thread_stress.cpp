// Services against the cycle, for ThreadSanitizer: built and run by test_thread_sanitizer.py with
// the core's sources. Argument: seconds. No gtest, so that everything in it is instrumented.
#include <pthread.h>
#include <time.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "ctrl_more/feedback_controllers_manager.hpp"

// ThreadSanitizer of GCC 12 does not know this function, which timed locks call.
extern "C" int pthread_mutex_clocklock(pthread_mutex_t* mutex, clockid_t clock,
                                       const timespec* end) noexcept {
  while (pthread_mutex_trylock(mutex) != 0) {
    timespec now{};
    clock_gettime(clock, &now);
    if (now.tv_sec > end->tv_sec || (now.tv_sec == end->tv_sec && now.tv_nsec >= end->tv_nsec)) {
      return ETIMEDOUT;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  return 0;
}

namespace {

using namespace ctrl_more;

class Pusher : public FeedbackController {
 public:
  Description describe() const override {
    Description d;
    d.type = "Pusher";
    d.measured("wrench").size(6).in("N, Nm").frameOf("base").about("read");
    d.modifies(ControlContainer::TaskSpaceReferencePose, "ee")
        .in("m, 1")
        .frameOf("base")
        .bounded({10, 1e9, 3, 1e9})
        .about("shifted");
    d.gain("k", 0.01).range(0, 1).in("1").about("share");
    return d;
  }
  void initialize(Setup& setup) override {
    wrench_ = setup.read<Wrench>("wrench");
    pose_ = setup.modify<Pose>("ee");
    k_ = setup.gain("k");
  }
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates&,
              ModifiedControlStates& modified) override {
    modified[pose_].head<3>() += scalar(k_) * robot.view(wrench_).head<3>();
    if (cycle.number % 997 == 0) fail("now and then");
    if (cycle.number % 1499 == 0) throw std::runtime_error("and this");
    if (cycle.number % 100 == 0) CTRL_MORE_LOG(log(), Info, "cycle {}", cycle.number);
  }

 private:
  Read<Wrench> wrench_;
  Modify<Pose> pose_;
  Gain k_;
};

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 5.0;
  Logger logger;
  logger.startDraining(5);
  RobotStates robot(&logger);
  ControlStates control(7, 0.005, &logger);
  ManagerOptions options;
  options.blend_s = 0.02;
  options.timed = true;
  FeedbackControllersManager manager(robot, control, options, &logger);
  std::vector<std::string> names;
  for (int i = 0; i < 8; ++i) {
    names.push_back("c" + std::to_string(i));
    ControllerEntry entry;
    entry.enabled = true;
    manager.addController(std::make_unique<Pusher>(), names.back(), entry);
  }
  manager.setProfile("few", {"c0", "c3"});
  manager.setProfile("all", names);
  manager.freeze();
  SignalMailbox mailbox(robot.find(RobotSource::Measured, "wrench"));

  std::atomic<bool> run{true};
  std::thread cycle([&] {
    Cycle now{0, 0.005, 0};
    const ControlStates references = control;
    while (run) {
      ++now.number;
      now.now_ns += 5000000;
      mailbox.deliver(robot);
      control.copyValuesFrom(references);
      manager.update(now, robot, control);
    }
  });
  std::thread driver([&] {
    std::int64_t stamp = 0;
    while (run) {
      const double wrench[6] = {1, 2, 3, 0, 0, 0};
      mailbox.post(wrench, 6, stamp += 1000000);
    }
  });
  std::vector<std::thread> services;
  std::atomic<long> requests{0};
  for (int s = 0; s < 3; ++s) {
    services.emplace_back([&, s] {
      std::mt19937 random(s);
      int loaded = 0;
      while (run) {
        const std::string& name = names[random() % names.size()];
        Status status;
        switch (random() % 14) {
          case 0:
            status = manager.enable(name);
            break;
          case 1:
            status = manager.disable(name);
            break;
          case 2:
            status = manager.pause(name);
            break;
          case 3:
            status = manager.resume(name);
            break;
          case 4:
            status = manager.resume(name, "fault");
            break;
          case 5:
            status = manager.pauseAllUsingRobotState("wrench");
            break;
          case 6:
            status = manager.resumeAllUsingRobotState("wrench");
            break;
          case 7:
            status = manager.setGains(name, {{"k", {0.001 * (random() % 100)}}});
            break;
          case 8:
            status = manager.applyProfile(random() % 2 ? "few" : "all");
            break;
          case 9: {
            auto order = manager.getExecutionOrder();
            std::swap(order.front(), order.back());
            status = manager.setExecutionOrder(order);
            break;
          }
          case 10:
            manager.attribution();
            break;
          case 11:
            manager.statusAll();
            break;
          case 12: {
            std::ostringstream out;
            manager.plotAll(out);
            break;
          }
          case 13: {
            const std::string extra = "x" + std::to_string(s) + "_" + std::to_string(loaded++);
            manager.addController(std::make_unique<Pusher>(), extra);
            manager.unload(extra);
            break;
          }
        }
        if (status.generation() != 0) {
          if (random() % 4 == 0) manager.withdraw(status.generation());
          manager.waitAdopted(status.generation(), 0.01);
        }
        ++requests;
      }
    });
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  run = false;
  for (auto& service : services) service.join();
  driver.join();
  cycle.join();
  std::printf("%ld requests\n", requests.load());
  return requests > 100 ? 0 : 1;
}
