/// One FRI tick allocates nothing, in every mode, including requests, losses and bad datagrams.
#include <gtest/gtest.h>

#include <cstdlib>

#include "small_controller.hpp"

namespace {

thread_local bool counting = false;
thread_local std::size_t allocations = 0;

}  // namespace

// The C library's allocator with a counter in front: catches new, malloc and what libraries do.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  if (counting) ++allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) {
  if (counting) ++allocations;
  return __libc_realloc(p, size);
}
}

namespace lwr_fri_bridge {
namespace {

TEST(RealTime, theCounterCounts) {
  counting = true;
  delete new int(3);
  void* volatile p = std::malloc(10);
  std::free(p);
  counting = false;
  EXPECT_GE(allocations, 1U);
  allocations = 0;
}

TEST(RealTime, aTickAllocatesNothing) {
  for (const char* mode : {"position", "joint_impedance", "cartesian_impedance"}) {
    Bridge bridge(test::defaultConfig());
    test::SmallController robot(0.005);
    allocations = 0;
    const auto tick = [&](bool lose) {
      const fri::MeasurementDatagram m = robot.measure();
      std::uint8_t bytes[fri::kMeasurementSize];
      fri::encode(m, bytes);
      fri::CommandDatagram answer{};
      counting = true;
      bridge.answer(bytes, 700, robot.now(), answer);
      const bool answered = !lose && bridge.answer(bytes, sizeof bytes, robot.now(), answer);
      bridge.idle(robot.now());
      counting = false;
      robot.take(answered ? &answer : nullptr);
    };
    for (int i = 0; i < 5; ++i) tick(false);
    bridge.submit(mode);
    tick(false);
    const std::uint32_t start = bridge.submit("start");
    for (int i = 0; i < 10; ++i) tick(false);
    ASSERT_TRUE(bridge.outcome(start).success());
    for (int i = 0; i < 500; ++i) {
      test::drive(bridge, robot, Vector7::Constant(i % 200 < 100 ? 1.0 : -1.0));
      tick(i % 20 == 0);
    }
    bridge.submit("hold");
    for (int i = 0; i < 50; ++i) tick(false);
    bridge.submit("reset");
    bridge.submit("stop");
    for (int i = 0; i < 50; ++i) tick(false);
    EXPECT_EQ(robot.state, fri::FriState::Monitor) << mode;
    EXPECT_EQ(allocations, 0U) << mode;
  }
}

}  // namespace
}  // namespace lwr_fri_bridge
