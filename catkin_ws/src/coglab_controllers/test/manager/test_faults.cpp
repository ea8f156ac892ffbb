// Plug-ins that throw, return NaN or take too long: they are reported and affect no others.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <tuple>

#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

TEST(Faults, AnExceptionClassOfThePluginIsReportedAndNothingStaysLoaded) {
  VirtualRobot robot("{" + kTypes + "}");
  for (int round = 0; round < 3; ++round) {
    const Answer answer = robot.manager->load("odd", "test/Throwing");
    EXPECT_TRUE(refused(answer, {"'odd'", "test/Throwing", "an error of its own"}));
    EXPECT_EQ(answer.code, ReasonCode::InvalidArgument);
  }
  std::vector<std::string> ids, types;
  robot.manager->list(ids, types);
  EXPECT_TRUE(ids.empty());
}

TEST(Faults, AControllerWhoseAttachFailsIsNotLoadedAndItsIdStaysFree) {
  VirtualRobot robot;
  int attached = 0;
  const auto attach = [&](MotionController&, const MotionMaker&) {
    EXPECT_TRUE(refused(robot.manager->load("ptp", "coglab/PtpController"), {"in use"}));
    if (++attached == 1) throw std::runtime_error("no service for this one");
  };
  std::string type;
  EXPECT_TRUE(refused(robot.manager->load("ptp", "coglab/PtpController", attach), {"no service"}));
  EXPECT_TRUE(refused(robot.manager->switchTo("ptp", type), {"not loaded"}));
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->load("ptp", "coglab/PtpController", attach)));
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->switchTo("ptp", type)));
  EXPECT_EQ(attached, 2);
}

class Fault : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(Fault, GivesZeroVelocityItsReasonAndALivingManager) {
  VirtualRobot robot(std::string("{odd: {fault: ") + GetParam().first + "}, " + kTypes + "}");
  robot.loadBoth("ptp");
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->load("odd", "test/Misbehaving")));
  robot.switchTo("odd");
  for (int i = 0; i < 10; ++i) {
    robot.tick();
    EXPECT_GT(robot.command.velocity.norm(), 0.0);
  }
  for (int i = 0; i < 20; ++i) {
    robot.tick();
    EXPECT_EQ(robot.command.velocity, JointVector::Zero().eval());
  }
  const CycleReport report = robot.manager->report();
  EXPECT_TRUE(report.fault);
  EXPECT_EQ(report.state, ManagerState::Fault);
  EXPECT_NE(report.reason.str().find(GetParam().second), std::string::npos)
      << report.reason.c_str();
  EXPECT_NE(report.reason.str().find("'odd'"), std::string::npos);
  const Answer welcome = robot.manager->motionWelcome("odd", report);
  EXPECT_TRUE(refused(welcome, {"fault"}));
  EXPECT_EQ(welcome.code, ReasonCode::ControllerFault);
  robot.switchTo("ptp");
  EXPECT_EQ(robot.ptp().add({{-1.3, -0.6, 1.5, 1.7, 0.2, 0.2, 0.8}, {}, {}}).status,
            MotionAnswer::kStarted);
  robot.tick();
  robot.tick();
  EXPECT_GT(robot.command.velocity.norm(), 0.0);
  robot.switchTo("odd");  // afresh
  robot.tick();
  EXPECT_GT(robot.command.velocity.norm(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(Faults, Fault,
                         ::testing::Values(std::make_pair("throw", "told to throw"),
                                           std::make_pair("throw_int", "threw"),
                                           std::make_pair("nan", "not finite")));

/// Runs a controller that takes 20 ms (15 allowed) in each cycle except the fifth and the tenth,
/// and checks the reports. False if the machine delayed one of these two: then the series of slow
/// cycles is longer, and the rest cannot be checked.
bool overrunsWereJudged() {
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{odd: {fault: slow, after: 0, rest_every: 5, rests: 2}, overrun_time: 0.015, " +
                 kTypes + "}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  EXPECT_EQ(settings.cycle.overruns_to_fault, 5);
  settings.logger = &logger;
  std::atomic<bool> stop{false};
  ControllerManager manager(std::move(settings));
  std::thread services([&] {
    std::string type;
    EXPECT_TRUE(VirtualRobot::ok(manager.load("odd", "test/Misbehaving")));
    EXPECT_TRUE(VirtualRobot::ok(manager.switchTo("odd", type)));
    stop = true;
  });
  while (!stop) manager.cycle().idle(manager.now_ns());
  services.join();
  RobotSample sample;
  sample.position = kHome;
  sample.commanded_position = sample.position;
  sample.block = coglab_rt::MotionBlock::None;
  VelocityCommand command;
  const auto run = [&] {
    ++sample.sequence;
    sample.stamp_ns = manager.now_ns();
    manager.cycle().run(sample, 0.005, command);
    return manager.report();
  };
  std::uint64_t overruns = 0;
  for (int i = 1; i <= 10; ++i) {
    const CycleReport report = run();
    if (i % 5 == 0 && report.overruns != overruns) return false;
    overruns = report.overruns;
    EXPECT_EQ(overruns, static_cast<std::uint64_t>(i - i / 5));
    EXPECT_FALSE(report.fault) << report.reason.c_str();
    EXPECT_GT(command.velocity.norm(), 0.0);
  }
  for (int i = 1; i <= 5; ++i) {
    EXPECT_FALSE(manager.report().fault);
    run();
  }
  const CycleReport report = manager.report();
  EXPECT_TRUE(report.fault);
  EXPECT_EQ(report.faults, 1u);
  EXPECT_EQ(report.overruns, 13u);
  EXPECT_NE(report.reason.str().find(" 5 times "), std::string::npos) << report.reason.c_str();
  EXPECT_NE(report.reason.str().find(" ms, allowed 15.000 ms"), std::string::npos);
  EXPECT_EQ(command.velocity, JointVector::Zero().eval());
  return true;
}

TEST(Faults, OverrunsInARowFaultTheControllerAndSinglesDoNot) {
  constexpr int kAttempts = 20;
  for (int attempt = 0; attempt < kAttempts && !HasFailure(); ++attempt) {
    if (overrunsWereJudged()) return;
  }
  FAIL() << "in each of " << kAttempts << " attempts a quick cycle counted as an overrun";
}

/// Takes 20 ms.
class Slow : public ctrl_more::FeedbackController {
 public:
  ctrl_more::Description describe() const override {
    ctrl_more::Description description;
    description.type = "Slow";
    description.modifies(ctrl_more::ControlContainer::TaskSpaceReferencePose, "ee")
        .in("m, quaternion x y z w")
        .frameOf("base")
        .about("left as it is");
    return description;
  }
  void initialize(ctrl_more::Setup&) override {}
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates&) override {
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
    while (std::chrono::steady_clock::now() < end) {
    }
  }
};

TEST(Faults, SlowFeedbackControllerIsNotAFaultOfTheMotionController) {
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{odd: {fault: none}, overrun_time: 0.015, " + kTypes + "}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  ctrl_more::ControllerEntry entry;
  entry.blend_s = 0.0;
  ASSERT_TRUE(manager.feedback().addController(std::make_unique<Slow>(), "slow", entry).ok());
  ASSERT_TRUE(manager.feedback().setProfile("odd", {"slow"}).ok());
  std::atomic<bool> stop{false};
  std::thread services([&] {
    std::string type;
    EXPECT_TRUE(VirtualRobot::ok(manager.load("odd", "test/Misbehaving")));
    EXPECT_TRUE(VirtualRobot::ok(manager.switchTo("odd", type)));
    stop = true;
  });
  while (!stop) manager.cycle().idle(manager.now_ns());
  services.join();
  RobotSample sample;
  sample.position = kHome;
  sample.commanded_position = sample.position;
  sample.block = coglab_rt::MotionBlock::None;
  VelocityCommand command;
  for (int i = 0; i < 12; ++i) {
    ++sample.sequence;
    sample.stamp_ns = manager.now_ns();
    manager.cycle().run(sample, 0.005, command);
  }
  const CycleReport report = manager.report();
  EXPECT_FALSE(report.fault) << report.reason.c_str();
  EXPECT_LE(report.overruns, 2u);  // a busy machine may delay the motion controller itself
  EXPECT_GT(command.velocity.norm(), 0.0);
}

/// Follows the script of a test and records the calls of the cycle.
class Scripted : public MotionController {
 public:
  void configure(const MotionSetup&) override {}
  void adopt(const CycleInput&) override { call("adopt"); }
  void start(const CycleInput&) override { call("start"); }
  void stop() override { call("stop"); }
  void abort(const Reason& reason) override {
    why = reason;
    doing = MotionState::Aborted;
    call("abort");
  }
  void computeReference(const CycleInput&, References&) override { call("computeReference"); }
  void resolve(const CycleInput&, References& references) override {
    references.states.view<kMaxJoints>(references.joint_velocity) = velocity;
    call("resolve");
  }
  MotionState state() const override { return doing; }
  const Reason& reason() const override { return why; }

  JointVector velocity = JointVector::Zero();
  MotionState doing = MotionState::Running;
  Reason why;
  std::string throws;
  std::vector<std::string> calls;

 private:
  void call(const std::string& what) {
    calls.push_back(what);
    if (what == throws) throw std::runtime_error("told to");
  }
};

/// A robot on which it is loaded but not active yet.
struct ScriptedRobot : VirtualRobot {
  ScriptedRobot() {
    EXPECT_TRUE(ok(manager->load("script", "test/Scripted")));
    script = dynamic_cast<Scripted*>(manager->motion("script"));
  }
  Scripted* script = nullptr;
};

TEST(Faults, AControllerThatThrowsWhenEndedIsStillEnded) {
  ScriptedRobot robot;
  robot.script->throws = "abort";
  robot.switchTo("script");
  robot.sample.block = MotionBlock::Held;
  robot.tick();
  EXPECT_NE(robot.reason().find("'script'"), std::string::npos) << robot.reason();
  EXPECT_EQ(robot.manager->report().faults, 1u);
  EXPECT_EQ(std::count(robot.script->calls.begin(), robot.script->calls.end(), "abort"), 2);
  robot.script->throws = "stop";
  robot.sample.block = MotionBlock::None;
  robot.switchTo("script");  // at fault: afresh
  EXPECT_FALSE(robot.manager->report().fault) << robot.reason();
  EXPECT_EQ(robot.script->calls.back(), "adopt");
  robot.switchTo("");
  robot.tick();  // with the robot's new state
  EXPECT_EQ(robot.manager->report().state, ManagerState::Idle);
  EXPECT_EQ(robot.manager->report().reason.str(), "");
}

}  // namespace
}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER("test/Scripted", coglab_controllers::Scripted)
