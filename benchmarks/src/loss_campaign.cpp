/// What set-points do while datagrams are lost, for limits.py: `loss_campaign SEEDS` prints
///   approach PERIOD BEYOND SPEED ACCELERATION CROSSED FAILED
/// largest way (rad), speed (rad/s) and acceleration (rad/s^2) beyond a limit over all seeds and
/// losses, runs that crossed a limit, and runs that did not start or lost command mode; and
///   stop PERIOD RATIO SLOW
/// largest stopping angle with bursts of loss over that without, and stops not from full speed.
#include <cstdio>
#include <cstdlib>

#include "loss_campaign.hpp"

namespace {

using namespace lwr_fri_bridge::test;

constexpr double kPeriods[] = {0.020, 0.010, 0.005, 0.002, 0.001};
constexpr double kShares[] = {0.0, 0.01, 0.05, 0.10};

void approaches(double period, unsigned seeds) {
  SetPointExtremes worst;
  unsigned crossed = 0, failed = 0;
  for (const double share : kShares) {
    for (unsigned kind = 0; kind < 8; ++kind) {
      const bool bursts = (kind & 1U) != 0, extrapolates = (kind & 2U) != 0;
      for (unsigned seed = 0; seed < seeds; ++seed) {
        LossRun run({period, share, bursts, extrapolates, seed, (kind & 4U) != 0});
        const SetPointExtremes e = run.approach();
        failed += run.started() && run.commanding() ? 0 : 1;
        crossed += e.beyond > 0.0 ? 1 : 0;
        worst.beyond = std::max(worst.beyond, e.beyond);
        worst.speed = std::max(worst.speed, e.speed);
        worst.acceleration = std::max(worst.acceleration, e.acceleration);
      }
    }
  }
  std::printf("approach %g %.6g %.6g %.6g %u %u\n", period, std::max(0.0, worst.beyond),
              worst.speed, worst.acceleration, crossed, failed);
  std::fflush(stdout);
}

void stops(double period, unsigned seeds) {
  LossRun without({period, 0.0, false, true, 0}, true);
  const Stop reference = without.stop();
  double worst = 0.0;
  unsigned slow = reference.from_full_speed ? 0 : 1;
  for (unsigned seed = 0; seed < seeds; ++seed) {
    LossRun run({period, 0.10, true, true, seed}, true);
    const Stop stop = run.stop();
    slow += stop.from_full_speed ? 0 : 1;
    worst = std::max(worst, stop.angle);
  }
  std::printf("stop %g %.4f %u\n", period, worst / reference.angle, slow);
}

}  // namespace

int main(int argc, char** argv) {
  const auto seeds = static_cast<unsigned>(argc == 2 ? std::strtoul(argv[1], nullptr, 10) : 0);
  if (seeds == 0) {
    std::fprintf(stderr, "usage: %s SEEDS, a number above 0\n", argv[0]);
    return 2;
  }
  for (const double period : kPeriods) stops(period, seeds);
  for (const double period : kPeriods) approaches(period, seeds);
  return 0;
}
