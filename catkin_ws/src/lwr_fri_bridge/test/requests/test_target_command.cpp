/// Messages on target_joint_states: valid ones, and refusals by age, stamp, epoch and form.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "lwr_fri_bridge/requests/target_command.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr std::int64_t kMs = 1'000'000, kNow = 50'000 * kMs, kLongest = 100 * kMs;

struct Message {
  std::vector<std::string> names;
  std::vector<double> velocities = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7};
  bool stamped = true;
  std::int64_t age_ns = 5 * kMs;
  std::string epoch;
  TargetVerdict judge(std::uint32_t now_epoch = 7, std::int64_t since = 0) const {
    return judgeTarget({names, velocities, stamped, age_ns, epoch},
                       {now_epoch, since, kNow, kLongest});
  }
};

TEST(TargetCommand, KeepsTheAgeAndEpochOfItsSource) {
  Message m;
  m.epoch = "7";
  const TargetVerdict verdict = m.judge();
  ASSERT_EQ(verdict.fault, TargetFault::None) << verdict.sentence;
  EXPECT_EQ(verdict.command.stamp_ns, kNow - 5 * kMs);  // not the time of receipt
  EXPECT_EQ(verdict.command.motion_epoch, 7U);
  EXPECT_DOUBLE_EQ(verdict.command.velocity[6], 0.7);
}

/// Hold and reset during the transport of a message: detected by its epoch, else by its stamp.
TEST(TargetCommand, CommandsFromBeforeThePermissionMoveNothing) {
  Message m;
  m.epoch = "6";
  EXPECT_EQ(m.judge().fault, TargetFault::Epoch);
  m.age_ns = 0;  // a manager that has not heard of the hold yet: a fresh stamp, the old epoch
  EXPECT_EQ(m.judge().fault, TargetFault::Epoch);
  m.epoch.clear();
  m.age_ns = 5 * kMs;
  EXPECT_EQ(m.judge(7, kNow - 4 * kMs).fault, TargetFault::Epoch);
  EXPECT_EQ(m.judge(7, kNow - 6 * kMs).fault, TargetFault::None);
}

TEST(TargetCommand, ExtremeStampsAreRefusedWithAReason) {
  Message m;
  m.stamped = false;
  EXPECT_EQ(m.judge().fault, TargetFault::Stamp);
  EXPECT_NE(m.judge().sentence.find("header.stamp is zero"), std::string::npos);
  m.stamped = true;
  for (const std::int64_t age :
       {kLongest + 1, 10'000 * kMs, std::int64_t{4294967295} * 1'000'000'000,
        -kFutureAllowance_ns - 1, -10'000 * kMs, -std::int64_t{4294967295} * 1'000'000'000}) {
    for (const char* epoch : {"", "7"}) {
      m.age_ns = age;
      m.epoch = epoch;
      EXPECT_EQ(m.judge().fault, TargetFault::Stamp) << age;
      EXPECT_NE(m.judge().sentence.find("clock"), std::string::npos);
    }
  }
  m.age_ns = -kFutureAllowance_ns;  // a stamp ahead makes nothing live longer
  EXPECT_EQ(m.judge().command.stamp_ns, kNow);
}

TEST(TargetCommand, MalformedMessagesAreRefused) {
  const auto fault = [](auto change) {
    Message m;
    change(m);
    const TargetVerdict verdict = m.judge();
    EXPECT_EQ(verdict.fault == TargetFault::None, verdict.sentence.empty());
    return verdict.fault;
  };
  EXPECT_EQ(fault([](Message& m) { m.velocities.resize(6); }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.velocities.clear(); }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.velocities[3] = NAN; }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.velocities[3] = INFINITY; }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.names.assign(7, "lwr_a1"); }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.names.assign(7, "nobody"); }), TargetFault::Invalid);
  EXPECT_EQ(fault([](Message& m) { m.names.assign(8, "lwr_a1"); }), TargetFault::Invalid);
  for (const char* epoch : {"x", "7 ", " 7", "-7", "7.0", "4294967303", "lwr_base_link"})
    EXPECT_EQ(fault([&](Message& m) { m.epoch = epoch; }), TargetFault::Invalid) << epoch;
}

TEST(TargetCommand, NamesSortIntoWireOrder) {
  Message m;
  m.names = {"lwr_a6", "lwr_a5", "lwr_a4", "lwr_a3", "lwr_e1", "lwr_a2", "lwr_a1"};
  const TargetVerdict verdict = m.judge();
  ASSERT_EQ(verdict.fault, TargetFault::None) << verdict.sentence;
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(verdict.command.velocity[i], 0.7 - 0.1 * i, 1e-12);
}

}  // namespace
}  // namespace lwr_fri_bridge
