/// The whole campaign of test/loss_campaign.hpp: `loss_campaign [SEEDS]` prints one line per
/// figure, `name value...`, for bench_fri.py.
#include <cstdio>
#include <cstdlib>

#include "../test/loss_campaign.hpp"

namespace {

using namespace lwr_fri_bridge::test;

constexpr double kPeriods[] = {0.020, 0.010, 0.005, 0.002, 0.001};  // where losses cost most first
constexpr double kShares[] = {0.0, 0.01, 0.05, 0.10};

/// Worst of all seeds; the last two numbers count runs that crossed a bound, and runs that did not
/// start or in which the controller left command mode.
void approaches(double period, unsigned seeds, bool clean_first) {
  for (const double share : kShares) {
    double beyond = -1e9, speed = 0.0, acceleration = 0.0;
    unsigned crossed = 0, failed = 0;
    for (const bool bursts : {false, true}) {
      for (const bool extrapolates : {true, false}) {
        for (unsigned seed = 0; seed < seeds; ++seed) {
          LossRun run({period, share, bursts, extrapolates, seed, clean_first});
          const SetPointExtremes e = run.approach();
          failed += run.started() && run.commanding() ? 0 : 1;
          crossed += e.beyond > 0.0 ? 1 : 0;
          beyond = std::max(beyond, e.beyond);
          speed = std::max(speed, e.speed);
          acceleration = std::max(acceleration, e.acceleration);
        }
      }
    }
    std::printf("%s %g %g %.4f %.6g %.6g %u %u\n", clean_first ? "later" : "approach", period,
                share, 1e3 * std::max(0.0, beyond), speed, acceleration, crossed, failed);
    std::fflush(stdout);
  }
}

/// Mean and largest angle of stopping with 10 % loss over that without, on a controller that
/// extrapolates (one that stands stops shorter); the last number counts stops that were not from
/// full speed, and so show nothing.
void stops(unsigned seeds) {
  for (const double period : kPeriods) {
    LossRun without({period, 0.0, false, true, 0}, true);
    const Stop reference = without.stop();
    for (const bool bursts : {false, true}) {
      double sum = 0.0, worst = 0.0;
      unsigned slow = reference.from_full_speed ? 0 : 1;
      for (unsigned seed = 0; seed < seeds; ++seed) {
        LossRun run({period, 0.10, bursts, true, seed}, true);
        const Stop stop = run.stop();
        slow += stop.from_full_speed ? 0 : 1;
        sum += stop.angle;
        worst = std::max(worst, stop.angle);
      }
      std::printf("stop %g %d %.6f %.4f %.4f %u\n", period, bursts ? 1 : 0, reference.angle,
                  sum / seeds / reference.angle, worst / reference.angle, slow);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const unsigned long seeds_given = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 1000;
  const auto seeds = static_cast<unsigned>(seeds_given);
  if (seeds == 0) {
    std::fprintf(stderr, "usage: %s [SEEDS], a number above 0\n", argv[0]);
    return 2;
  }
  for (const double period : kPeriods) std::printf("motion %g %.4f\n", period, motionTime(period));
  stops(seeds);
  for (const double period : kPeriods) {
    approaches(period, seeds, false);
    approaches(period, seeds, true);
  }
  return 0;
}
