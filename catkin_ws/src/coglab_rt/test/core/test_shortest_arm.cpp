/// The example of docs/arm_back_end.md under a control loop as the manager has one.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <thread>
#include <tuple>
#include <vector>

#include "example/shortest_arm.hpp"

namespace {

template <typename Condition>
bool within(double seconds, const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

TEST(ShortestArm, FollowsWhatIsCommandedAndStandsWhenCommandsEnd) {
  ShortestArm arm;
  std::atomic<int> woken{0};
  std::atomic<bool> commanding{true};
  std::atomic<double> position{0.0}, velocity{0.0};
  arm.start([&](bool measured) {
    // The control thread of the real thing is woken here; this one thread does for both.
    ++woken;
    coglab_rt::RobotSample sample;
    if (!measured || !arm.mailboxes().newestSample(sample)) return;
    position = sample.position[0];
    velocity = sample.velocity[0];
    if (commanding) {
      arm.mailboxes().sendVelocity(
          {coglab_rt::Vector7::Constant(0.5), sample.stamp_ns, sample.motion_epoch});
    }
  });
  EXPECT_TRUE(within(20.0, [&] { return position > 0.05; }));
  commanding = false;
  EXPECT_TRUE(within(20.0, [&] { return velocity == 0.0; }));
  const double stood = position;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(position, stood);
  arm.shutdown();
  const int last = woken;
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(woken, last);
  arm.shutdown();
}

/// Samples of an arm to which one command is sent, from the first one on.
std::vector<coglab_rt::RobotSample> samplesUnder(double velocity, double stamp_age,
                                                 std::uint32_t epoch) {
  constexpr std::size_t kSamples = 4;
  ShortestArm arm;
  std::vector<coglab_rt::RobotSample> samples;
  std::atomic<bool> enough{false};
  const auto stamp = coglab_rt::steadyNow() - static_cast<std::int64_t>(1e9 * stamp_age);
  arm.mailboxes().sendVelocity({coglab_rt::Vector7::Constant(velocity), stamp, epoch});
  arm.start([&](bool) {
    coglab_rt::RobotSample sample;
    if (samples.size() < kSamples && arm.mailboxes().newestSample(sample))
      samples.push_back(sample);
    enough = samples.size() == kSamples;
  });
  EXPECT_TRUE(within(20.0, [&] { return enough.load(); }));
  arm.shutdown();
  return samples;
}

TEST(ShortestArm, WhatIsTooOldOfAnotherEpochOrNoNumberDoesNotMoveIt) {
  for (const auto& [velocity, age, epoch] : {std::tuple<double, double, unsigned>{0.5, 0.06, 0},
                                             {0.5, 0.0, 1},
                                             {std::nan(""), 0.0, 0}}) {
    const auto samples = samplesUnder(velocity, age, epoch);
    ASSERT_FALSE(samples.empty());
    for (const auto& sample : samples) EXPECT_TRUE(sample.velocity.isZero(0.0)) << age;
    EXPECT_TRUE(samples.back().position.isZero(0.0));
  }
}

}  // namespace
