/// Time of one of 100 feedback controllers per cycle: as it runs on a robot (bounds, rates, time
/// and attribution), and called in a bare loop. Each reads an IMU and changes a pose.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "ctrl_more/feedback_controllers_manager.hpp"

namespace {

using namespace ctrl_more;

constexpr int kControllers = 100;

class Typical : public FeedbackController {
 public:
  explicit Typical(bool bounded) : bounded_(bounded) {}
  Description describe() const override {
    Description d;
    d.type = "Typical";
    d.measured("imu").size(9).in("rad").frameOf("imu").about("read");
    ControlSignalUse& pelvis = d.modifies(ControlContainer::TaskSpaceReferencePose, "pelvis");
    pelvis.in("m").frameOf("w").about("x");
    if (bounded_) pelvis.bounded({0.1, 1.0, 0.1, 1.0});
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
  bool bounded_;
  Read<9> imu_;
  Modify<Pose> pelvis_;
};

/// States of a robot and a manager with the controllers.
struct Bench {
  explicit Bench(bool guarded) {
    control.declare(ControlContainer::TaskSpaceReferencePose, "pelvis", 7);
    robot.setMeasuredData("imu", Eigen::VectorXd::Constant(9, 0.1), 0);
    ManagerOptions options;
    options.blend_s = 0.0;
    options.timed = guarded;
    manager = std::make_unique<FeedbackControllersManager>(robot, control, options, &logger);
    ControllerEntry entry;
    entry.enabled = true;
    entry.overrun_us = guarded ? 1e6 : 0.0;  // where a duration is judged, it is measured
    for (int i = 0; i < kControllers; ++i) {
      auto controller = std::make_unique<Typical>(guarded);
      bare.push_back(controller.get());
      const Status status =
          manager->addController(std::move(controller), "c" + std::to_string(i), entry);
      if (!status) std::fprintf(stderr, "%s\n", status.message().c_str());
    }
    manager->freeze();
  }

  Logger logger;
  RobotStates robot{&logger};
  ControlStates control{0, 0.005, &logger};
  Cycle cycle{0, 0.005, 0};
  std::unique_ptr<FeedbackControllersManager> manager;
  std::vector<Typical*> bare;
};

void guarded(benchmark::State& state) {
  Bench bench(true);
  for (auto _ : state) {
    ++bench.cycle.number;
    bench.manager->update(bench.cycle, bench.robot, bench.control);
  }
  std::uint64_t faults = 0;
  for (const auto& status : bench.manager->statusAll()) faults += status.faults;
  if (faults != 0 || bench.manager->attribution().size() != kControllers)
    state.SkipWithError("controllers were faulted, or their corrections were not recorded");
  state.SetItemsProcessed(state.iterations() * kControllers);
}

void bareLoop(benchmark::State& state) {
  Bench bench(false);
  ControlStates original = bench.control;
  for (auto _ : state) {
    ++bench.cycle.number;
    original.copyValuesFrom(bench.control);
    std::uint32_t owner = 0;
    for (Typical* controller : bench.bare) {
      ModifiedControlStates modified(bench.control, ++owner);
      controller->update(bench.cycle, bench.robot, original, modified);
    }
  }
  state.SetItemsProcessed(state.iterations() * kControllers);
}

}  // namespace

BENCHMARK(guarded);
BENCHMARK(bareLoop);
BENCHMARK_MAIN();
