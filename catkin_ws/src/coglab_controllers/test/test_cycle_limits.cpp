// The control cycle at its limits: which joint states count, when silence, a border and a slow
// clock act, what stands, and what it tells.
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

struct Cycle : ::testing::Test {
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

TEST_F(Cycle, AJointStateCountsIfEachOfItsNumbersIsFinite) {
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

TEST_F(Cycle, TheTimeBetweenJointStatesIsAboveZeroAndATenthOfASecondAtMost) {
  begin();
  move();
  for (const auto& [dt, words] : {std::pair(0.0, "not newer"),
                                  {-0.001, "not newer"},
                                  {kNan, "not newer"},
                                  {0.10001, "no joint state for 0.1"}}) {
    const CycleReport now = run(robot->sample, dt);
    EXPECT_EQ(now.reason.code(), ReasonCode::StaleJointState) << dt;
    EXPECT_NE(now.reason.str().find(words), std::string::npos) << now.reason.str();
    EXPECT_TRUE(robot->command.velocity.isZero(0.0));
  }
  const CycleReport fine = run(robot->sample, 0.1);
  EXPECT_TRUE(fine.reason.empty()) << fine.reason.str();
  EXPECT_EQ(fine.dt, 0.1);
}

TEST_F(Cycle, SilenceIsToldAfterATenthAndEndsAMotionAfterHalfASecond) {
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

TEST_F(Cycle, TheSetPointStandsWithoutVelocityAndAccelerationTwoCyclesLong) {
  robot = std::make_unique<VirtualRobot>();
  EXPECT_FALSE(report().standing) << "of one cycle";
  robot->tick();
  EXPECT_TRUE(report().standing);
  RobotSample moving = robot->sample;
  moving.commanded_velocity[3] = 1e-12;
  EXPECT_FALSE(run(moving).standing);
  moving = robot->sample;
  moving.commanded_acceleration[6] = -1e-6;
  EXPECT_FALSE(run(moving).standing);
  EXPECT_TRUE(run(robot->sample).standing);
  robot->manager->cycle().idle(robot->now_ns + 50 * kMs);
  EXPECT_TRUE(report().standing) << "a lost measurement is no silence";
  robot->manager->cycle().idle(robot->now_ns + 150 * kMs);
  EXPECT_FALSE(report().standing);
}

TEST_F(Cycle, ARobotThatStopsOrLeavesCommandModeForAMomentEndsTheMotion) {
  begin();
  move();
  robot->sample.block = MotionBlock::Held;
  robot->tick();
  EXPECT_EQ(report().motion, MotionState::Aborted);
  EXPECT_EQ(report().reason.code(), ReasonCode::Held);
  EXPECT_EQ(report().reason.str().find("the robot stopped the motion: hold is latched; send reset"),
            0u);
  robot->sample.block = MotionBlock::None;
  robot->tick();
  move();
  ++robot->sample.motion_epoch;
  robot->tick();
  EXPECT_EQ(report().motion, MotionState::Aborted);
  EXPECT_EQ(report().reason.code(), ReasonCode::NotInCommandMode);
  EXPECT_NE(report().reason.str().find("for a moment"), std::string::npos);
}

TEST_F(Cycle, AMotionThatWasReachedAndFollowsItsGoalEndsWhenTheRobotLeftCommandMode) {
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

TEST_F(Cycle, TheClockOfAMotionIsSlowedByTheGuardAsTheArmIs) {
  begin("hand_speed_limit: 0.1");
  ASSERT_EQ(robot->ptp().add({turned(0.8), {}, {}}).status, MotionAnswer::kStarted);
  double slowest = 1.0, behind = 0.0, fastest = 0.0;
  for (int i = 0; i < 4000 && (i < 3 || report().motion == MotionState::Running); ++i) {
    robot->tick();
    slowest = std::min(slowest, report().time_scale);
    fastest = std::max(fastest, robot->handVelocity().norm());
    if (report().guard.reason == GuardReason::HandSpeed) behind += 0.005;
  }
  EXPECT_EQ(report().motion, MotionState::Reached) << report().reason.str();
  EXPECT_NEAR(fastest, 0.085, 1e-3);  // what is kept of the limit
  EXPECT_LT(slowest, 0.5);            // 0.57 rad/s of 0.6 m would be 0.34 m/s
  EXPECT_GT(slowest, 0.1);
  EXPECT_GT(behind, 1.0);
}

TEST_F(Cycle, ItTellsWhatItCountsAndDoes) {
  begin();
  const CycleReport before = report();
  EXPECT_EQ(before.state, ManagerState::Idle);
  EXPECT_EQ(before.active.str(), "ptp");
  EXPECT_EQ(before.longest, 0.0) << "in lockstep nothing is timed";
  EXPECT_EQ(before.duration, 0.0);
  EXPECT_EQ(before.faults + before.overruns + before.stale, 0u);
  const std::uint64_t beats = robot->manager->cycle().heartbeat();
  robot->tick();
  robot->manager->cycle().idle(robot->now_ns + kMs);
  EXPECT_EQ(report().cycles, before.cycles + 2);
  EXPECT_EQ(report().samples, before.samples + 1);
  EXPECT_EQ(robot->manager->cycle().heartbeat(), beats + 2);
  EXPECT_FALSE(robot->manager->cycle().inPlugin());
  EXPECT_EQ(report().generation, before.generation);
  robot->switchTo("dmp");
  EXPECT_EQ(report().generation, before.generation + 1);
  robot->switchTo("ptp");
  move();
  EXPECT_EQ(report().state, ManagerState::Running);
  EXPECT_EQ(report().velocity, robot->command.velocity);
  EXPECT_EQ(report().robot.stamp_ns, robot->now_ns);
  EXPECT_EQ(report().dt, 0.005);
  EXPECT_TRUE(report().reason.empty());
  ASSERT_TRUE(robot->manager->setSpeedScale(0.25).success);
  robot->tick();
  EXPECT_EQ(report().speed_scale, 0.25);
  EXPECT_NEAR(report().time_scale, 0.95, 1e-9) << "it falls by ten per second";
  robot->manager->cycle().idle(robot->now_ns + kMs);
  EXPECT_NEAR(report().time_scale, 0.95, 1e-9) << "and not without a joint state";
  robot->switchTo("");
  robot->tick();
  robot->sample.block = MotionBlock::NoPower;
  robot->tick();
  EXPECT_EQ(report().reason.code(), ReasonCode::NoPower);
  EXPECT_EQ(report().state, ManagerState::Idle);
}

TEST_F(Cycle, ACancelOfAControllerThatIsNotActiveEndsNothingLater) {
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

TEST(FirstJointState, IsNoStopOfTheRobotAndTheSecondMayBe) {
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
  EXPECT_EQ(manager.report().reason.str(), "no joint state from the robot yet");
  RobotSample sample = plain.sample;
  VelocityCommand command;
  sample.motion_epoch = 5;
  manager.cycle().run(sample, 0.005, command);
  EXPECT_EQ(manager.report().motion, MotionState::Running);
  EXPECT_EQ(command.motion_epoch, 5u);
  sample.motion_epoch = 6;
  manager.cycle().run(sample, 0.005, command);
  EXPECT_EQ(manager.report().reason.str(),
            "the robot stopped the motion: it left command mode for a moment");
}

TEST(VoidReason, ARequestIsVoidAfterACancelOrAStopOfTheRobot) {
  CycleInput input;
  EXPECT_EQ(input.time_scale, 1.0);
  EXPECT_FALSE(input.motion_allowed);
  EXPECT_EQ(RequestStamp().cancels, 0u);
  EXPECT_EQ(RequestStamp().motion_epoch, 0u);
  input.cancels = 3;
  input.robot.motion_epoch = 5;
  EXPECT_TRUE(voidReason({3, 5}, input).empty());
  EXPECT_EQ(voidReason({2, 5}, input).code(), ReasonCode::Cancelled);
  EXPECT_EQ(voidReason({3, 4}, input).code(), ReasonCode::TooLate);
}

TEST(MotionCancel, IsTakenOnceAndServesThoseBeforeIt) {
  MotionCancel cancel;
  Reason reason;
  EXPECT_EQ(cancel.newest(), 0u);
  EXPECT_FALSE(cancel.take(reason));
  EXPECT_TRUE(cancel.served(0));
  EXPECT_EQ(cancel.ask(Reason(ReasonCode::Cancelled, "one")), 1u);
  EXPECT_EQ(cancel.ask(Reason(ReasonCode::Cancelled, "two")), 2u);
  EXPECT_EQ(cancel.newest(), 2u);
  EXPECT_EQ(cancel.taken(), 0u);
  EXPECT_FALSE(cancel.served(1));
  ASSERT_TRUE(cancel.take(reason));
  EXPECT_EQ(reason.str(), "two");
  EXPECT_FALSE(cancel.take(reason));
  EXPECT_EQ(cancel.taken(), 2u);
  cancel.confirm(true);
  EXPECT_TRUE(cancel.served(1) && cancel.served(2) && !cancel.served(3));
  EXPECT_TRUE(cancel.endedMotion(1) && cancel.endedMotion(2));
  EXPECT_EQ(cancel.ask(reason), 3u);
  ASSERT_TRUE(cancel.take(reason));
  cancel.confirm(false);
  EXPECT_TRUE(cancel.served(3));
  EXPECT_FALSE(cancel.endedMotion(3));
}

TEST(States, HaveTheirNames) {
  const std::pair<MotionState, std::string> motions[] = {{MotionState::Idle, "idle"},
                                                         {MotionState::Running, "running"},
                                                         {MotionState::Holding, "holding"},
                                                         {MotionState::Reached, "reached"},
                                                         {MotionState::Aborted, "aborted"}};
  for (const auto& [state, name] : motions) EXPECT_EQ(nameOf(state), name);
  const std::pair<ManagerState, std::string> managers[] = {{ManagerState::Idle, "idle"},
                                                           {ManagerState::Running, "running"},
                                                           {ManagerState::Holding, "holding"},
                                                           {ManagerState::Fault, "fault"}};
  for (const auto& [state, name] : managers) EXPECT_EQ(nameOf(state), name);
}

TEST(Arrival, IsThereWithinItsToleranceAndStuckAfterItsTime) {
  using State = Arrival::State;
  for (const std::string given : {"{settle_time: 0.5}", "{}"}) {
    Arrival arrival;
    arrival.configure(Parameters(YAML::Load(given), "x"));
    const int waits = given == "{}" ? 8 : 2;
    for (int round = 0; round < 2; ++round) {
      arrival.begin();
      for (int i = 0; i < waits; ++i) EXPECT_EQ(arrival.update(0.25, 0.11, 0.1), State::Waiting);
      EXPECT_EQ(arrival.update(0.25, 0.1, 0.1), State::There);
      EXPECT_EQ(arrival.update(0.25, 0.11, 0.1), State::Stuck);
    }
  }
  Arrival unset;
  for (int i = 0; i < 8; ++i) EXPECT_EQ(unset.update(0.25, 0.11, 0.1), State::Waiting);
  EXPECT_EQ(unset.update(0.25, 0.11, 0.1), State::Stuck);
  EXPECT_EQ(Arrival::handStuck(0.25).code(), ReasonCode::TargetNotReached);
  EXPECT_NE(Arrival::handStuck(0.25).str().find("goal: 0.25"), std::string::npos);
}

TEST(StartBlend, FadesWithItsTimeConstant) {
  StartBlend blend;
  for (const auto& [time, left] :
       {std::pair(0.15, std::exp(-2.0)), {0.6, std::exp(-0.5)}, {0.0, 0.0}}) {
    if (time != 0.15) blend.setTime(time);
    blend.begin(Vector3(1, 2, 3), Vector3(0.1, 0, 0), JointVector::Constant(0.5));
    blend.advance(0.3);
    EXPECT_LT((blend.position() - left * Vector3(1, 2, 3)).norm(), 1e-12);
    EXPECT_LT((blend.rotation() - left * Vector3(0.1, 0, 0)).norm(), 1e-12);
    EXPECT_LT((blend.joints() - left * JointVector::Constant(0.5)).norm(), 1e-12);
  }
}

TEST(MotionReference, HasTheVelocitiesThatLeadFromOneToTheOther) {
  MotionReference rest(0.02);
  EXPECT_EQ(rest.space, MotionReference::Space::Rest);
  EXPECT_FALSE(rest.jumps);
  EXPECT_EQ(rest.share, 1.0);
  rest.joints(JointVector::Constant(0.1), JointVector::Constant(0.2));
  EXPECT_TRUE(rest.joint_velocity.isApprox(JointVector::Constant(5.0)));
  EXPECT_EQ(rest.space, MotionReference::Space::Joint);
  const Pose now{Vector3(0.1, 0, 0), Quaternion::Identity()};
  const Pose next{Vector3(0.1, 0.02, 0), expRotation(Vector3(0, 0, 0.04))};
  rest.pose(now, next);
  EXPECT_LT((rest.tool.velocity - Vector3(0, 1, 0)).norm(), 1e-12);
  EXPECT_LT((rest.tool.angular_velocity - Vector3(0, 0, 2)).norm(), 1e-12);
  EXPECT_TRUE(rest.tool.orientation_control);
  EXPECT_LT((rest.nextTool().position - next.position).norm(), 1e-12);
  EXPECT_LT(rest.nextTool().orientation.angularDistance(next.orientation), 1e-9);
  rest.rest();
  EXPECT_EQ(rest.space, MotionReference::Space::Rest);
  MotionReference second;
  second.joints(JointVector::Zero(), JointVector::Constant(0.2));
  EXPECT_EQ(second.joint_velocity, JointVector::Constant(0.2).eval());
}

}  // namespace
}  // namespace coglab_controllers
