// Measures the cost of the guard, in interleaved blocks, and prints one JSON object. Driven by
// bench_feedback.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <vector>

#include "ctrl_more/feedback_controllers_manager.hpp"

namespace {

using namespace ctrl_more;

// The typical controller: one read of an IMU, one read-modify-write of a pose.
class Typical : public FeedbackController {
 public:
  /// @param bounded declares bounds of size and rate, in position and angle
  explicit Typical(bool bounded = false) : bounded_(bounded) {}
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

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Stores and managers of the same controllers, run in turn.
class Bench {
 public:
  Bench() {
    control_.declare(ControlContainer::TaskSpaceReferencePose, "pelvis", 7);
    robot_.setMeasuredData("imu", Eigen::VectorXd::Constant(9, 0.1), 0);
    guarded_ = manager(false, false);
    timed_ = manager(false, true);
    bounded_ = manager(true, true);
    unguarded_ = std::make_unique<Unguarded>(kControllers, robot_, control_, logger_);
    guarded_->freeze();
    original_ = control_;
  }

  // One block of each; the median of the blocks counts.
  void block() {
    measure(unguarded_ns, [this] { unguarded_->update(cycle_, robot_, control_, original_); });
    measure(guarded_ns, [this] { guarded_->update(cycle_, robot_, control_); });
    measure(timed_ns, [this] { timed_->update(cycle_, robot_, control_); });
    measure(bounded_ns, [this] { bounded_->update(cycle_, robot_, control_); });
  }

  std::uint64_t faults() const {
    std::uint64_t count = 0;
    for (const auto* manager : {guarded_.get(), timed_.get(), bounded_.get()}) {
      for (const auto& status : manager->statusAll()) count += status.faults;
    }
    return count;
  }

  /// Controllers whose correction of the last cycle was recorded.
  std::size_t attributed() const { return bounded_->attribution().size(); }

  static constexpr int kControllers = 100, kCycles = 400;
  std::vector<double> unguarded_ns, guarded_ns, timed_ns, bounded_ns;  // one for each block

 private:
  std::unique_ptr<FeedbackControllersManager> manager(bool bounded, bool timed) {
    ManagerOptions options;
    options.blend_s = 0.0;
    options.timed = timed;
    auto manager =
        std::make_unique<FeedbackControllersManager>(robot_, control_, options, &logger_);
    ControllerEntry entry;
    entry.enabled = true;
    entry.overrun_us = timed ? 1e6 : 0.0;  // where a duration is judged, it is measured
    for (int i = 0; i < kControllers; ++i) {
      const Status status = manager->addController(std::make_unique<Typical>(bounded),
                                                   "c" + std::to_string(i), entry);
      if (!status) std::fprintf(stderr, "%s\n", status.message().c_str());
    }
    return manager;
  }

  void measure(std::vector<double>& times, const std::function<void()>& update) {
    const auto block = [&] {
      for (int i = 0; i < kCycles; ++i) {
        ++cycle_.number;
        update();
      }
    };
    times.push_back(nanoseconds(block, kCycles, kControllers));
  }

  Logger logger_;
  RobotStates robot_{&logger_};
  ControlStates control_{0, 0.005, &logger_};
  ControlStates original_{0, 0.005, &logger_};
  Cycle cycle_{0, 0.005, 0};
  std::unique_ptr<FeedbackControllersManager> guarded_, timed_, bounded_;
  std::unique_ptr<Unguarded> unguarded_;
};

}  // namespace

// Argument: number of blocks.
int main(int argc, char** argv) {
  const int blocks = argc > 1 ? std::atoi(argv[1]) : 150;
  Bench bench;
  for (int block = 0; block < blocks; ++block) bench.block();
  std::printf(
      "{\"controllers\": %d, \"unguarded_ns\": %.3f, \"guarded_ns\": %.3f, "
      "\"timed_ns\": %.3f, \"bounded_ns\": %.3f, \"faults\": %llu, \"attributed\": %zu}\n",
      Bench::kControllers, median(bench.unguarded_ns), median(bench.guarded_ns),
      median(bench.timed_ns), median(bench.bounded_ns),
      static_cast<unsigned long long>(bench.faults()), bench.attributed());
  return 0;
}
