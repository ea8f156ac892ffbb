/// @file
/// Times one step of the interpolator (7 axes, 1 ms, a new target in every step, as the bridge runs
/// it). Prints the median of 200 blocks of 10 000 steps, in us of processor time of the thread, so
/// that other work on the machine does not count.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <random>
#include <vector>

#include "lwr_fri_bridge/interpolator.hpp"

namespace {

std::int64_t processorTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace lwr_fri_bridge;
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s joint_limits.yaml\n", argv[0]);
    return 2;
  }
  const JointLimits limits = loadJointLimits(argv[1]);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  std::vector<Vector7> targets(4096);
  for (Vector7& target : targets) {
    for (int i = 0; i < 7; ++i) target[i] = part(random) * limits.velocity[i];
  }
  Interpolator interpolator(limits);
  constexpr int kBlocks = 200, kSteps = 10'000;
  std::vector<double> us;
  double guard = 0.0;
  for (int block = 0; block < kBlocks; ++block) {
    const std::int64_t begin = processorTime();
    // A target holds for 5 steps as with a 200 Hz controller on a 1 kHz connection.
    for (int step = 0; step < kSteps; ++step) {
      interpolator.step(targets[static_cast<std::size_t>(step / 5) % targets.size()], 0.001);
    }
    us.push_back(1e-3 * static_cast<double>(processorTime() - begin) / kSteps);
    guard += interpolator.position().sum();
    interpolator.resume(Vector7::Zero(), interpolator.velocity(), interpolator.acceleration());
  }
  std::sort(us.begin(), us.end());
  std::printf("%.6f %.6f\n", us[us.size() / 2], guard);
  return 0;
}
