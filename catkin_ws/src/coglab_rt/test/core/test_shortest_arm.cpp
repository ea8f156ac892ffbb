/// The example of docs/arm_back_end.md under a control loop as the manager has one.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

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

TEST(ShortestArm, FollowsCommandsAndStandsWhenTheyEnd) {
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

}  // namespace
