/// The ideal arm in lockstep: permission and end of a motion, and the limits at all times.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include "coglab_controllers/ideal/ideal_arm.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace {
thread_local bool counting = false;
std::size_t allocations = 0;
}  // namespace

// The C library's allocator with a counter in front.
extern "C" {
void* __libc_malloc(std::size_t);
void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
}

namespace coglab_controllers {
namespace {

using coglab_rt::MotionBlock;
using coglab_rt::RobotSample;
using coglab_rt::Vector7;

IdealArmConfig config(double period = 0.005) {
  IdealArmConfig config;
  config.limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  config.period = period;
  return config;
}

/// The arm with its clock.
class Arm {
 public:
  explicit Arm(const IdealArmConfig& setup = config()) : arm(setup) { tick(); }

  void tick() {
    now_ns += static_cast<std::int64_t>(std::llround(1e9 * arm.config().period));
    arm.tick(now_ns);
    arm.mailboxes().newestSample(sample);
  }
  void send(const Vector7& velocity) {
    arm.mailboxes().sendVelocity({velocity, sample.stamp_ns, sample.motion_epoch});
  }
  void drive(int ticks, const Vector7& velocity) {
    for (int i = 0; i < ticks; ++i) {
      send(velocity);
      tick();
    }
  }
  void ask(const std::string& event) {
    const coglab_rt::Answer answer = arm.request(event);
    ASSERT_TRUE(answer.success) << answer.message;
    tick();
    ASSERT_EQ(arm.served(), arm.requested());
  }

  IdealArm arm;
  RobotSample sample;
  std::int64_t now_ns = 1'000'000'000;
};

TEST(IdealArm, StandsUntilStartAndFollowsThen) {
  Arm arm;
  EXPECT_EQ(arm.sample.sequence, 1U);
  EXPECT_EQ(arm.sample.block, MotionBlock::Monitor);
  arm.drive(50, Vector7::Constant(0.1));
  EXPECT_EQ(arm.sample.position, arm.arm.config().start_position);
  arm.ask("start");
  EXPECT_EQ(arm.sample.block, MotionBlock::None);
  const RobotSample before = arm.sample;
  arm.drive(400, Vector7::Constant(0.1));
  EXPECT_TRUE(arm.sample.velocity.isApprox(Vector7::Constant(0.1)));
  EXPECT_NEAR(arm.sample.position[0] - before.position[0], 0.2, 0.01);
  EXPECT_EQ(arm.sample.controller_ns - before.controller_ns, 2'000'000'000);
  EXPECT_EQ(arm.sample.commanded_position, arm.sample.position);
}

TEST(IdealArm, CommandsFromBeforeThePermissionAreIgnored) {
  Arm arm;
  arm.send(Vector7::Constant(0.5));
  arm.ask("start");
  const Vector7 before = arm.sample.position;
  arm.tick();
  EXPECT_EQ(arm.sample.position, before);
}

TEST(IdealArm, HoldBrakesLatchesAndNeedsReset) {
  Arm arm;
  arm.ask("start");
  arm.drive(100, Vector7::Constant(0.3));
  ASSERT_TRUE(arm.arm.request("hold").success);
  ASSERT_TRUE(arm.arm.request("reset").success);  // at once: it brakes all the same
  const std::uint32_t epoch = arm.sample.motion_epoch;
  arm.tick();
  EXPECT_EQ(arm.sample.block, MotionBlock::Held);
  EXPECT_EQ(arm.sample.motion_epoch, epoch + 1);
  for (int i = 0; i < 200 && !arm.arm.stands(); ++i) arm.tick();
  EXPECT_TRUE(arm.arm.stands());
  arm.tick();
  EXPECT_EQ(arm.sample.block, MotionBlock::None);
  EXPECT_EQ(arm.sample.motion_epoch, epoch + 2);

  arm.ask("hold");
  const coglab_rt::Answer refused = arm.arm.request("start");
  EXPECT_FALSE(refused.success);
  EXPECT_EQ(refused.code, coglab_rt::ReasonCode::Held);
  const Vector7 held = arm.sample.position;
  arm.drive(50, Vector7::Constant(0.3));
  EXPECT_EQ(arm.sample.position, held);
  arm.ask("reset");
  arm.drive(50, Vector7::Constant(0.3));
  EXPECT_GT(arm.sample.position[0], held[0]);
}

TEST(IdealArm, AHoldThatIsResetBeforeAStandingArmSawItChangesNothing) {
  Arm arm;
  arm.ask("start");
  const std::uint32_t epoch = arm.sample.motion_epoch;
  ASSERT_TRUE(arm.arm.request("hold").success);
  ASSERT_TRUE(arm.arm.request("reset").success);
  arm.drive(50, Vector7::Constant(0.3));
  EXPECT_EQ(arm.sample.block, MotionBlock::None);
  EXPECT_EQ(arm.sample.motion_epoch, epoch);
  EXPECT_TRUE(arm.sample.velocity.isApprox(Vector7::Constant(0.3)));
}

TEST(IdealArm, StopBrakesAndNeedsStart) {
  Arm arm;
  arm.ask("start");
  arm.drive(100, Vector7::Constant(0.3));
  arm.ask("stop");
  EXPECT_EQ(arm.sample.block, MotionBlock::Stopping);
  for (int i = 0; i < 200 && !arm.arm.stands(); ++i) arm.tick();
  arm.tick();
  EXPECT_EQ(arm.sample.block, MotionBlock::Monitor);
  IdealArmView view;
  EXPECT_TRUE(arm.arm.newestView(view));
  EXPECT_EQ(view.state, IdealArmState::Monitor);
}

TEST(IdealArm, BrakesWhenCommandsEndAndIgnoresNonFiniteOnes) {
  Arm arm;
  arm.ask("start");
  arm.drive(100, Vector7::Constant(0.3));
  arm.send(Vector7::Constant(std::nan("")));
  arm.tick();
  EXPECT_TRUE(arm.sample.velocity.isApprox(Vector7::Constant(0.3)));
  for (int i = 0; i < 7; ++i) arm.tick();
  EXPECT_TRUE(arm.sample.velocity.isApprox(Vector7::Constant(0.3)));
  for (int i = 0; i < 100; ++i) arm.tick();
  EXPECT_TRUE(arm.arm.stands());
  EXPECT_TRUE(arm.sample.position.allFinite());
  arm.drive(100, Vector7::Constant(0.3));
  EXPECT_TRUE(arm.sample.velocity.isApprox(Vector7::Constant(0.3)));
}

TEST(IdealArm, ScalesTheWholeVector) {
  Arm arm;
  arm.ask("start");
  Vector7 wanted;
  wanted << 20.0, 1.0, 0.0, -4.0, 0.0, 0.0, 2.0;
  arm.drive(60, wanted);
  EXPECT_TRUE(
      arm.sample.velocity.isApprox(wanted / 20.0 * arm.arm.config().limits.velocity[0], 1e-9));
}

/// 120 000 ticks of random commands, most of them out of bounds, with holds, resets, stops, starts.
TEST(IdealArm, LimitsHoldByDifferentiation) {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  const char* const events[] = {"hold", "reset", "stop", "start", "start", "start"};
  for (const double period : {0.001, 0.005, 0.02}) {
    Arm arm(config(period));
    const coglab_rt::JointLimits& limits = arm.arm.config().limits;
    arm.ask("start");
    Vector7 target = Vector7::Zero();
    int at_end = 0;
    for (int i = 0; i < 40000; ++i) {
      if (i % static_cast<int>(1.0 / period) == 0) {
        for (int joint = 0; joint < 7; ++joint)
          target[joint] = 3.0 * part(random) * limits.velocity[joint];
      }
      if (i % 997 == 0) {
        arm.arm.request(events[random() % 6]);
        arm.arm.request("reset");
        arm.arm.request(random() % 4 == 0 ? "stop" : "start");
      }
      const RobotSample last = arm.sample;
      arm.drive(1, target);
      const RobotSample& now = arm.sample;
      const Vector7 dp = (now.position - last.position) / period;
      const Vector7 dv = (now.velocity - last.velocity) / period;
      const Vector7 da = (now.commanded_acceleration - last.commanded_acceleration) / period;
      for (int joint = 0; joint < 7; ++joint) {
        ASSERT_LE(std::abs(dp[joint]), limits.velocity[joint] * (1.0 + 1e-9) + 1e-12 / period);
        ASSERT_LE(std::abs(dv[joint]), limits.acceleration[joint] * (1.0 + 1e-9));
        ASSERT_LE(std::abs(da[joint]), limits.jerk[joint] * (1.0 + 1e-9));
        ASSERT_GE(now.position[joint], limits.lower_position[joint] + limits.position_margin);
        ASSERT_LE(now.position[joint], limits.upper_position[joint] - limits.position_margin);
        at_end += limits.upper_position[joint] - now.position[joint] < 0.2 ? 1 : 0;
      }
    }
    EXPECT_GT(at_end, 100) << "the ends of the ranges were not reached";
  }
}

TEST(IdealArm, ATickAllocatesNothing) {
  Arm arm;
  counting = true;
  int* volatile kept = new int(3);  // volatile, so that the compiler does not remove it
  delete kept;
  counting = false;
  EXPECT_EQ(allocations, 1U) << "the counter does not count";
  allocations = 0;
  arm.ask("start");
  for (int i = 0; i < 2000; ++i) {
    if (i == 1000) ASSERT_TRUE(arm.arm.request("hold").success);
    counting = true;
    arm.drive(1, Vector7::Constant(i % 200 < 100 ? 1.0 : -1.0));
    counting = false;
  }
  EXPECT_EQ(allocations, 0U);
}

TEST(IdealArm, RefusesWhatItCannotDoAndParametersOutOfRange) {
  Arm arm;
  EXPECT_EQ(arm.arm.request("jump").code, coglab_rt::ReasonCode::InvalidArgument);
  EXPECT_EQ(arm.arm.request("joint_impedance stiffness 500").code,
            coglab_rt::ReasonCode::NotSupported);
  EXPECT_TRUE(arm.arm.request("position").success);
  for (const auto& [event, words] :
       {std::pair("jump", "'jump'"), std::pair("jump", "start, stop, hold, reset, position"),
        std::pair("cartesian_impedance 1", "'cartesian_impedance 1'"),
        std::pair("cartesian_impedance 1", "arm:=fri")}) {
    const std::string said = arm.arm.request(event).message;
    EXPECT_NE(said.find(words), std::string::npos) << said;
  }
  const auto refusal = [](auto&& change) {
    IdealArmConfig bad = config();
    change(bad);
    try {
      const IdealArm arm(bad);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string slow = refusal([](IdealArmConfig& c) { c.period = 0.5; });
  EXPECT_NE(slow.find("period = 0.5"), std::string::npos) << slow;
  EXPECT_NE(slow.find("0.001..0.1"), std::string::npos) << slow;
  EXPECT_NE(
      refusal([](IdealArmConfig& c) { c.command_timeout = std::nan(""); }).find("command_timeout"),
      std::string::npos);
  EXPECT_NE(
      refusal([](IdealArmConfig& c) { c.start_position[3] = 9.0; }).find("start_position[3] = 9"),
      std::string::npos);
}

}  // namespace
}  // namespace coglab_controllers
