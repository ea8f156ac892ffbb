// Measures the cost of the guard, in interleaved blocks, and prints one JSON object. Driven by
// bench_feedback.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <vector>

#include "ctrl_more/feedback_controllers_manager.hpp"

namespace {

using namespace ctrl_more;

// The typical controller: one read of an IMU, one read-modify-write of a pose.
class Typical : public FeedbackController {
 public:
  Description describe() const override {
    Description d;
    d.type = "Typical";
    d.measured("imu").size(9).in("rad").frameOf("imu").about("read");
    d.modifies(ControlContainer::TaskSpaceReferencePose, "pelvis").in("m").frameOf("w").about("x");
    return d;
  }
  void initialize(Setup& setup) override {
    imu_ = setup.read<9>("imu");
    pelvis_ = setup.modify<Pose>("pelvis");
  }
  void update(const Cycle&, const RobotStates& robot, const ControlStates&,
              ModifiedControlStates& modified) override {
    modified[pelvis_].head<3>() += 1e-9 * robot.view(imu_).head<3>();
  }

 private:
  Read<9> imu_;
  Modify<Pose> pelvis_;
};

// The same controllers without manager: the floor that the guard is compared with.
class Unguarded {
 public:
  Unguarded(int count, RobotStates& robot, ControlStates& control, Logger& logger)
      : manager_(robot, control, {}, &logger) {
    for (int i = 0; i < count; ++i) {
      auto controller = std::make_unique<Typical>();
      raw_.push_back(controller.get());
      const Status status = manager_.addController(std::move(controller), "u" + std::to_string(i));
      if (!status) std::fprintf(stderr, "%s\n", status.message().c_str());
    }
  }
  void update(const Cycle& cycle, const RobotStates& robot, ControlStates& control,
              ControlStates& original) {
    original.copyValuesFrom(control);
    std::uint32_t owner = 0;
    for (Typical* controller : raw_) {
      ModifiedControlStates modified(control, ++owner);
      controller->update(cycle, robot, original, modified);
    }
  }

 private:
  FeedbackControllersManager manager_;  // configures the instances; does not run them
  std::vector<Typical*> raw_;
};

double nanoseconds(const std::function<void()>& block, int cycles, int controllers) {
  const auto begin = std::chrono::steady_clock::now();
  block();
  const auto end = std::chrono::steady_clock::now();
  return std::chrono::duration<double, std::nano>(end - begin).count() / cycles / controllers;
}

}  // namespace

// Argument: number of blocks.
int main(int argc, char** argv) {
  constexpr int kControllers = 100, kCycles = 400;
  const int blocks = argc > 1 ? std::atoi(argv[1]) : 150;
  Logger logger;
  RobotStates robot(&logger);
  ControlStates control(0, 0.005, &logger);
  control.declare(ControlContainer::TaskSpaceReferencePose, "pelvis", 7);
  ManagerOptions plain, timed;
  plain.blend_s = timed.blend_s = 0.0;
  timed.timed = true;
  FeedbackControllersManager guarded(robot, control, plain, &logger);
  FeedbackControllersManager guarded_timed(robot, control, timed, &logger);
  ControllerEntry entry;
  entry.enabled = true;
  for (int i = 0; i < kControllers; ++i) {
    for (FeedbackControllersManager* manager : {&guarded, &guarded_timed}) {
      // Where a duration is judged, it is measured.
      entry.overrun_us = manager == &guarded_timed ? 1e6 : 0.0;
      const Status status =
          manager->addController(std::make_unique<Typical>(), "c" + std::to_string(i), entry);
      if (!status) std::fprintf(stderr, "%s\n", status.message().c_str());
    }
  }
  robot.setMeasuredData("imu", Eigen::VectorXd::Constant(9, 0.1), 0);
  Unguarded unguarded(kControllers, robot, control, logger);
  guarded.freeze();
  ControlStates original = control;
  Cycle cycle{0, 0.005, 0};

  double floor_ns = std::numeric_limits<double>::max(), guarded_ns = floor_ns, timed_ns = floor_ns;
  for (int block = 0; block < blocks; ++block) {
    floor_ns = std::min(floor_ns, nanoseconds([&] {
      for (int i = 0; i < kCycles; ++i) {
        ++cycle.number;
        unguarded.update(cycle, robot, control, original);
      }
    }, kCycles, kControllers));
    guarded_ns = std::min(guarded_ns, nanoseconds([&] {
      for (int i = 0; i < kCycles; ++i) {
        ++cycle.number;
        guarded.update(cycle, robot, control);
      }
    }, kCycles, kControllers));
    timed_ns = std::min(timed_ns, nanoseconds([&] {
      for (int i = 0; i < kCycles; ++i) {
        ++cycle.number;
        guarded_timed.update(cycle, robot, control);
      }
    }, kCycles, kControllers));
  }
  std::uint64_t faults = 0;
  for (const auto& status : guarded.statusAll()) faults += status.faults;
  for (const auto& status : guarded_timed.statusAll()) faults += status.faults;
  std::printf("{\"controllers\": %d, \"unguarded_ns\": %.3f, \"guarded_ns\": %.3f, "
              "\"timed_ns\": %.3f, \"faults\": %llu}\n",
              kControllers, floor_ns, guarded_ns, timed_ns,
              static_cast<unsigned long long>(faults));
  return 0;
}
