/// @file
/// The figures of bench_interpolator.py, one line each:
///
///   time LIMITS_FILE      median of 200 blocks of 10 000 steps (7 axes, 1 ms, a new target every 5
///                         steps, as with a 200 Hz controller at 1 kHz), us of processor time of
///                         the thread, so that other work on the machine does not count
///   limits LIMITS_FILE    largest share by which speed, acceleration and jerk exceed their limits
///                         (negative: they stay below), each by one difference of the next lower
///                         quantity, at 1, 5, 20, 100 ms; then by how much speed (rad/s) and
///                         acceleration (rad/s^2) do on the float32 wire
///   braking LIMITS_FILE   number of random states, then the largest way beyond a position limit
///                         when every joint is driven towards one at top speed, rad
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "coglab_rt/joint_limits_table.hpp"
#include "lwr_fri_bridge/names.hpp"

namespace {

using namespace lwr_fri_bridge;

std::mt19937 generator(1);
double part() { return std::uniform_real_distribution<double>(-1.0, 1.0)(generator); }

std::int64_t processorTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

void printTime(const JointLimits& limits) {
  std::vector<Vector7> targets(4096);
  for (Vector7& target : targets) {
    for (int i = 0; i < 7; ++i) target[i] = part() * limits.velocity[i];
  }
  Interpolator interpolator(limits);
  constexpr int kBlocks = 200, kSteps = 10'000;
  std::vector<double> us;
  double guard = 0.0;
  for (int block = 0; block < kBlocks; ++block) {
    const std::int64_t begin = processorTime();
    for (int step = 0; step < kSteps; ++step) {
      interpolator.step(targets[static_cast<std::size_t>(step / 5) % targets.size()], 0.001);
    }
    us.push_back(1e-3 * static_cast<double>(processorTime() - begin) / kSteps);
    guard += interpolator.position().sum();
    interpolator.resume(Vector7::Zero(), interpolator.velocity(), interpolator.acceleration());
  }
  std::sort(us.begin(), us.end());
  std::printf("%.6f %.6f\n", us[us.size() / 2], guard);
}

/// Largest |value| / limit - 1 so far.
void excess(const Vector7& value, const Vector7& limit, double& worst) {
  worst = std::max(worst, (value.cwiseAbs().cwiseQuotient(limit)).maxCoeff() - 1.0);
}

void printLimits(const JointLimits& limits) {
  double speed = -1.0, acceleration = -1.0, jerk = -1.0, wire_speed = -10.0,
         wire_acceleration = -10.0;
  for (const double dt : {0.001, 0.005, 0.020, 0.100}) {
    Interpolator interpolator(limits);
    const BrakingGuard guard(limits,
                             0.01);  // keeps positions where float32 has its true resolution
    interpolator.reset(Vector7::Zero());
    Vector7 target = Vector7::Zero(), wire = Vector7::Zero(), wire_v = Vector7::Zero();
    for (int step = 0; step < 100'000; ++step) {
      if (step % 17 == 0) {
        for (int i = 0; i < 7; ++i) target[i] = 1.5 * part() * limits.velocity[i];
      }
      const Vector7 p = interpolator.position(), v = interpolator.velocity(),
                    a = interpolator.acceleration();
      Vector7 bounded = target;
      guard.bound(interpolator, dt, bounded);
      interpolator.step(bounded, dt);
      excess((interpolator.position() - p) / dt, limits.velocity, speed);
      excess((interpolator.velocity() - v) / dt, limits.acceleration, acceleration);
      excess((interpolator.acceleration() - a) / dt, limits.jerk, jerk);
      const Vector7 sent = interpolator.position().cast<float>().cast<double>();
      const Vector7 sent_v = (sent - wire) / dt;
      const Vector7 sent_a = (sent_v - wire_v) / dt;
      wire_speed = std::max(wire_speed, (sent_v.cwiseAbs() - limits.velocity).maxCoeff());
      wire_acceleration =
          std::max(wire_acceleration, (sent_a.cwiseAbs() - limits.acceleration).maxCoeff());
      wire = sent;
      wire_v = sent_v;
    }
  }
  std::printf("%.3e %.3e %.3e %.3e %.3e\n", speed, acceleration, jerk, wire_speed,
              wire_acceleration);
}

/// A random state of a joint from which braking at once stays inside: others are lost for any
/// guard.
AxisState randomState(const JointLimits& limits, int i) {
  for (;;) {
    const AxisState s{limits.upper_position[i] * part(), limits.velocity[i] * part(),
                      limits.acceleration[i] * part()};
    const coglab_rt::BrakingReach reach =
        coglab_rt::brakingReach(s.velocity, s.acceleration, limits.acceleration[i], limits.jerk[i]);
    const double peak =
        s.velocity + s.acceleration * std::abs(s.acceleration) / (2.0 * limits.jerk[i]);
    if (std::abs(peak) <= limits.velocity[i] &&
        s.position + reach.highest <= limits.upper_position[i] &&
        s.position + reach.lowest >= limits.lower_position[i]) {
      return s;
    }
  }
}

void printBraking(const JointLimits& limits) {
  const BrakingGuard guard(limits, 0.0);
  constexpr int kStates = 10'000;
  double beyond = -10.0;
  long states = 0;
  for (const double dt : {0.001, 0.005, 0.020}) {
    for (int trial = 0; trial < kStates / 7 / 3 + 1; ++trial, states += 7) {
      Vector7 p, v, a, wanted;
      for (int i = 0; i < 7; ++i) {
        const AxisState s = randomState(limits, i);
        p[i] = s.position;
        v[i] = s.velocity;
        a[i] = s.acceleration;
        wanted[i] = part() > 0.0 ? 10.0 : -10.0;  // far beyond top speed
      }
      Interpolator interpolator(limits);
      interpolator.resume(p, v, a);
      for (int step = 0; step < static_cast<int>(4.5 / dt); ++step) {
        Vector7 target = wanted;
        guard.bound(interpolator, dt, target);
        interpolator.step(target, dt);
        const Vector7& q = interpolator.position();
        beyond = std::max({beyond, (q - limits.upper_position).maxCoeff(),
                           (limits.lower_position - q).maxCoeff()});
        if (interpolator.velocity().cwiseAbs().maxCoeff() < 1e-4) break;  // all stand at a border
      }
    }
  }
  std::printf("%ld %.3e\n", states, beyond);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string mode = argc > 2 ? argv[1] : "";
  if (mode != "time" && mode != "limits" && mode != "braking") {
    std::fprintf(stderr, "usage: %s time|limits|braking joint_limits.yaml\n", argv[0]);
    return 2;
  }
  const JointLimits limits = coglab_rt::loadJointLimits(argv[2]);
  if (mode == "time") printTime(limits);
  if (mode == "limits") printLimits(limits);
  if (mode == "braking") printBraking(limits);
  return 0;
}
