// Limits of the control cycle: valid joint states; effects of silence, a border and a slow clock;
// standstill; reports.
#include <cmath>
#include <limits>

#include "coglab_controllers/motion/reference_loop.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kMs = 1'000'000;

std::vector<double> turned(double angle, int joint = 0) {
  std::vector<double> there(kHome.data(), kHome.data() + 7);
  there[static_cast<std::size_t>(joint)] += angle;
  return there;
}

struct CycleLimits : ::testing::Test {
  void begin(const std::string& parameters = "") {
    robot = std::make_unique<VirtualRobot>(parameters);
    robot->loadBoth("ptp");
  }
  void move(double angle = 0.8) {
    ASSERT_EQ(robot->ptp().add({turned(angle), {}, {}}).status, MotionAnswer::kStarted);
    for (int i = 0; i < 60; ++i) robot->tick();
    ASSERT_EQ(report().motion, MotionState::Running);
    ASSERT_GT(robot->command.velocity.norm(), 0.05);
  }
  /// A cycle on this joint state, with this time since the last.
  CycleReport run(RobotSample sample, double dt = 0.005) {
    robot->now_ns += 5 * kMs;
    sample.stamp_ns = robot->now_ns;
    robot->manager->cycle().run(sample, dt, robot->command);
    return report();
  }
  CycleReport report() { return robot->manager->report(); }

  std::unique_ptr<VirtualRobot> robot;
};

TEST_F(CycleLimits, AJointStateCountsIfEachOfItsNumbersIsFinite) {
  begin();
  move();
  JointVector RobotSample::*const fields[] = {&RobotSample::position,
                                              &RobotSample::velocity,
                                              &RobotSample::torque,
                                              &RobotSample::external_torque,
                                              &RobotSample::commanded_position,
                                              &RobotSample::commanded_velocity,
                                              &RobotSample::commanded_acceleration};
  std::uint64_t stale = 0;
  for (int i = 0; i < 8; ++i) {
    RobotSample bad = robot->sample;
    if (i < 7) {
      (bad.*fields[i])[i] = i % 2 == 0 ? kNan : INFINITY;
    } else {
      bad.tool_wrench[5] = kNan;
    }
    const CycleReport now = run(bad);
    EXPECT_EQ(now.stale, ++stale) << i;
    EXPECT_EQ(now.reason.code(), ReasonCode::StaleJointState) << i;
    EXPECT_NE(now.reason.str().find("not finite"), std::string::npos);
    EXPECT_TRUE(robot->command.velocity.isZero(0.0)) << i;
    EXPECT_EQ(robot->command.stamp_ns, robot->now_ns);
    EXPECT_FALSE(now.standing);
  }
  EXPECT_EQ(run(robot->sample).stale, stale);
  EXPECT_GT(robot->command.velocity.norm(), 0.05) << "and the motion goes on";
}

TEST_F(CycleLimits, TheTimeBetweenJointStatesIsAboveZeroAndATenthOfASecondAtMost) {
  begin();
  move();
  for (const auto& [dt, words] : {std::pair(0.0, "not newer"),
                                  {-0.001, "not newer"},
                                  {kNan, "not newer"},
                                  {0.10001, "for 0.1"}}) {
    const CycleReport now = run(robot->sample, dt);
    EXPECT_EQ(now.reason.code(), ReasonCode::StaleJointState) << dt;
    EXPECT_NE(now.reason.str().find(words), std::string::npos) << now.reason.str();
    EXPECT_TRUE(robot->command.velocity.isZero(0.0));
  }
  const CycleReport fine = run(robot->sample, 0.1);
  EXPECT_TRUE(fine.reason.empty()) << fine.reason.str();
  EXPECT_EQ(fine.dt, 0.1);
}

TEST_F(CycleLimits, SilenceIsReportedAfterATenthAndEndsAMotionAfterHalfASecond) {
  begin();
  move();
  ControlCycle& cycle = robot->manager->cycle();
  cycle.idle(robot->now_ns + 100 * kMs);
  EXPECT_TRUE(report().reason.empty()) << report().reason.str();
  cycle.idle(robot->now_ns + 101 * kMs);
  EXPECT_EQ(report().reason.code(), ReasonCode::StaleJointState);
  EXPECT_NE(report().reason.str().find("more than 0.1"), std::string::npos);
  EXPECT_EQ(report().motion, MotionState::Running);
  EXPECT_TRUE(report().velocity.isZero(0.0));
  cycle.idle(robot->now_ns + 500 * kMs);
  EXPECT_EQ(report().motion, MotionState::Running);
  cycle.idle(robot->now_ns + 501 * kMs);
  EXPECT_EQ(report().motion, MotionState::Aborted);
}

TEST_F(CycleLimits, FollowingMotionEndsWhenTheRobotLeavesCommandMode) {
  begin();
  robot->switchTo("dmp");
  const Vector3 goal(0.8, 0.0, 0.45);
  const auto tick = [&] {
    robot->see("human_hand", goal);
    robot->tick();
  };
  robot->see("human_hand", goal);
  ASSERT_TRUE(VirtualRobot::ok(robot->dmp().execute(robot->reach())));
  for (int i = 0; i < 2000 && report().motion != MotionState::Reached; ++i) tick();
  for (int i = 0; i < 300; ++i) tick();
  robot->sample.block = MotionBlock::Held;
  tick();
  EXPECT_EQ(report().motion, MotionState::Reached) << "nothing moves that could be ended";
  ++robot->sample.motion_epoch;
  tick();
  EXPECT_EQ(report().motion, MotionState::Aborted);
  EXPECT_EQ(report().reason.code(), ReasonCode::Held);
}

TEST_F(CycleLimits, ACancelOfAControllerThatIsNotActiveEndsNothingLater) {
  begin();
  const CancelOrder order = robot->manager->askCancel("dmp", "");
  CancelAnswer answer;
  EXPECT_FALSE(robot->manager->cancelEnded(order, answer));
  robot->tick();
  EXPECT_FALSE(robot->manager->cancelEnded(order, answer)) << "a cycle may have been under way";
  robot->tick();
  EXPECT_TRUE(robot->manager->cancelEnded(order, answer));
  const CancelOrder before = robot->manager->askCancel("dmp", "");
  robot->switchTo("dmp");
  EXPECT_FALSE(before.cancel->endedMotion(before.number));
  robot->see("human_hand", Vector3(0.8, 0.0, 0.45));
  ASSERT_TRUE(VirtualRobot::ok(robot->dmp().execute(robot->reach())));
  robot->tick();
  EXPECT_EQ(report().motion, MotionState::Running);
}

TEST(FirstJointState, IsNeverAStopOfTheRobotButTheSecondCanBe) {
  const VirtualRobot plain;
  ctrl_more::Logger logger;
  ManagerSettings settings =
      readManagerSettings(YAML::Load("{" + kTypes + "}"),
                          readText(DESCRIPTION_DIR "/urdf/lwr_ih2.urdf"), plain.limits, true);
  EXPECT_EQ(settings.cycle.overrun_time, 0.0) << "nothing is timed in lockstep";
  settings.clock = [] { return 5000 * kMs; };
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  std::string type;
  ASSERT_TRUE(VirtualRobot::ok(manager.load("odd", "test/Misbehaving")));
  ASSERT_TRUE(VirtualRobot::ok(manager.switchTo("odd", type)));
  manager.cycle().idle(9000 * kMs);
  EXPECT_EQ(manager.report().reason.code(), ReasonCode::StaleJointState);
  RobotSample sample = plain.sample;
  VelocityCommand command;
  sample.motion_epoch = 5;
  manager.cycle().run(sample, 0.005, command);
  EXPECT_EQ(manager.report().motion, MotionState::Running);
  EXPECT_EQ(command.motion_epoch, 5u);
  sample.motion_epoch = 6;
  manager.cycle().run(sample, 0.005, command);
  EXPECT_EQ(manager.report().reason.code(), ReasonCode::NotInCommandMode);
}

}  // namespace
}  // namespace coglab_controllers
