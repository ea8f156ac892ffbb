// The controller manager in virtual time: loading, switching, faults, limits; D4.10 Table 6.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_rt/joint_limits_table.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

TEST(Manager, RefusesBadPluginsAndKeepsTheLoadedOnes) {
  VirtualRobot robot("{" + kTypes + "}");
  robot.loadBoth("ptp");
  ControllerManager& manager = *robot.manager;
  EXPECT_TRUE(VirtualRobot::ok(manager.load("odd", "test/Misbehaving")));
  EXPECT_TRUE(refused(manager.load("a", "test/Missing"), {"libnowhere.so", "not found"}));
  EXPECT_TRUE(refused(manager.load("a", "test/Empty"), {"no motion controller"}));
  EXPECT_TRUE(refused(manager.load("a", "test/Twin"), {"test/Misbehaving", "registered already"}));
  EXPECT_TRUE(refused(manager.load("a", "test/Twin"), {"registered already"}));  // and again
  EXPECT_TRUE(refused(manager.load("a", "test/Other"), {"has no type", "test/Misbehaving"}));
  EXPECT_TRUE(refused(manager.load("a", "test/OtherAbi"),
                      {"another coglab_controllers (interface ", "has interface "}));
  EXPECT_TRUE(
      refused(manager.load("a", "my_lab/Unknown"), {"my_lab/Unknown", "coglab/DmpController"}));
  EXPECT_TRUE(refused(manager.load("dmp", "coglab/DmpController"), {"in use"}));
  EXPECT_TRUE(refused(manager.load("", "coglab/DmpController"), {"controller_id"}));
  EXPECT_TRUE(refused(manager.load("a/b", "coglab/DmpController"), {"controller_id"}));
  std::vector<std::string> ids, types;
  manager.list(ids, types);
  EXPECT_EQ(ids, (std::vector<std::string>{"dmp", "ptp", "odd"}));
  EXPECT_EQ(types, (std::vector<std::string>{"coglab/DmpController", "coglab/PtpController",
                                             "test/Misbehaving"}));
  EXPECT_TRUE(VirtualRobot::ok(manager.load("odd2", "test/Misbehaving")));  // still makes new ones
}

TEST(Manager, LibraryThatIsCutShortIsRefused) {
  const std::string cut = ::testing::TempDir() + "libcut.so";
  std::filesystem::copy_file(PLUGIN_DIR "/libcoglab_test_own_exception.so", cut,
                             std::filesystem::copy_options::overwrite_existing);
  std::filesystem::resize_file(cut, 5000);
  VirtualRobot robot("{types: {test/Cut: " + cut + "}}");
  EXPECT_TRUE(refused(robot.manager->load("a", "test/Cut"), {"cut short"}));
}

TEST(Manager, LibraryWhoseConstructorCrashesIsRefused) {
  VirtualRobot robot("{types: {test/Crashing: " PLUGIN_DIR "/libcoglab_test_crashing.so}}");
  EXPECT_TRUE(refused(robot.manager->load("a", "test/Crashing"), {"crashed", "'test/Crashing'"}));
}

TEST(Manager, BadPluginsAndSwitchesLeaveARunningMotionAsItIs) {
  VirtualRobot robot("{" + kTypes + "}"), twin("{" + kTypes + "}");
  for (VirtualRobot* one : {&robot, &twin}) {
    one->loadBoth();
    ASSERT_TRUE(VirtualRobot::ok(one->manager->load("odd", "test/Misbehaving")));
    one->see("human_hand", kGoal);
    ASSERT_TRUE(VirtualRobot::ok(one->dmp().execute(one->reach())));
  }
  std::string type;
  for (int i = 0; i < 60; ++i) {
    if (i == 20) {
      EXPECT_TRUE(refused(robot.manager->load("a", "test/Missing"), {"not found"}));
      EXPECT_TRUE(refused(robot.manager->load("a", "test/Empty"), {"no motion controller"}));
      EXPECT_TRUE(refused(robot.manager->load("a", "test/Twin"), {"registered already"}));
    }
    if (i == 40) {
      EXPECT_TRUE(refused(robot.manager->switchTo("nobody", type), {"nobody", "dmp, ptp, odd"}));
      EXPECT_TRUE(refused(robot.manager->setSpeedScale(std::nan("")), {"speed_scale", "0", "1"}));
      EXPECT_TRUE(refused(robot.manager->setSpeedScale(-0.1), {"speed_scale"}));
    }
    for (VirtualRobot* one : {&robot, &twin}) {
      one->see("human_hand", kGoal);
      one->tick();
    }
    ASSERT_EQ(robot.command.velocity, twin.command.velocity);
  }
  EXPECT_EQ(robot.state(), MotionState::Running);
}

TEST(Manager, SwitchInMotionBrakesWithoutAJumpAndReportsUnfinished) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const std::vector<double> there = {-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6};
  EXPECT_EQ(robot.ptp().add({there, {}, {}}).id, 0);
  const MotionAnswer queued = robot.ptp().add({there, {}, {}});
  EXPECT_EQ(queued.status, MotionAnswer::kQueued);
  for (int i = 0; i < 100; ++i) robot.tick();
  ASSERT_GT(robot.command.velocity.norm(), 0.01);
  robot.switchTo("dmp");
  const JointVector before = robot.command.velocity;
  robot.tick();  // the interpolator brakes the slowest joint, and the others with it
  EXPECT_TRUE((robot.command.velocity.array().abs() <= before.array().abs() + 1e-12).all());
  EXPECT_TRUE((robot.command.velocity.array() == 0.0).any());
  for (int i = 0; i < 3; ++i) robot.tick();
  EXPECT_EQ(robot.command.velocity, JointVector::Zero().eval());
  EndedMotion end;
  std::vector<int> given_up;
  while (robot.ptp().readEnd(end)) {
    EXPECT_FALSE(end.executed);
    given_up.push_back(end.id);
  }
  EXPECT_EQ(given_up, (std::vector<int>{0, 1}));
  std::string type;
  EXPECT_TRUE(VirtualRobot::ok(robot.manager->switchTo("dmp", type)));  // is active: no effect
  EXPECT_EQ(type, "coglab/DmpController");
}

TEST(Manager, MotionBeginsWithTheCommandedVelocity) {
  VirtualRobot robot;
  robot.loadBoth();
  for (int i = 0; i < 5; ++i) robot.tick();
  // The arm moves with a velocity that a Cartesian motion can have.
  const Chain& chain = robot.manager->settings().robot->chain;
  const ChainState state = chain.evaluate(robot.sample.position);
  CartesianReference drift;
  drift.pose = state.tool;
  drift.velocity = Vector3(0.1, 0.05, 0.0);
  IkResult ik;
  IkParameters parameters;
  parameters.velocity_limit = robot.limits.velocity;
  TwoTaskIk(parameters).solve(state, robot.sample.position, drift, ik);
  robot.sample.commanded_velocity = ik.velocity;
  robot.sample.velocity = ik.velocity;
  robot.sample.commanded_position += JointVector::Constant(0.002);  // the arm lags behind
  robot.see("human_hand", kGoal);
  DmpRequest request = robot.reach();
  request.orientation_control = true;
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  robot.tick();
  EXPECT_LT((robot.command.velocity - ik.velocity).norm(), 0.05 * ik.velocity.norm() + 0.01);
}

TEST(Manager, ControlThreadIdlesWithoutARobotAndSurvivesAStall) {
  coglab_rt::ArmMailboxes mailboxes;
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{odd: {fault: stall, after: 0}, plan_timeout: 0.3, " + kTypes + "}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  ControlThreadOptions options;
  options.priority = 0;
  ControlThread thread(manager.cycle(), mailboxes, options);
  thread.start();
  std::string type;
  EXPECT_TRUE(VirtualRobot::ok(manager.load("ptp", "coglab/PtpController")));  // no robot yet
  EXPECT_TRUE(VirtualRobot::ok(manager.switchTo("ptp", type)));
  const Answer blind = manager.motionWelcome("ptp", manager.report());
  EXPECT_TRUE(refused(blind, {"no joint state"}));
  EXPECT_EQ(blind.code, ReasonCode::StaleJointState);
  EXPECT_TRUE(VirtualRobot::ok(manager.load("odd", "test/Misbehaving")));

  std::atomic<bool> stop{false};
  std::thread robot([&] {
    RobotSample sample;
    sample.position = kHome;
    sample.commanded_position = sample.position;
    sample.cycle_time = 0.005;
    sample.block = coglab_rt::MotionBlock::None;
    while (!stop) {
      ++sample.sequence;
      sample.controller_ns += 5'000'000;
      sample.stamp_ns = manager.now_ns();
      mailboxes.publishSample(sample);
      thread.wake(true);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  // Its stall of 1.5 s begins with the next sample, which is late on a busy computer.
  bool stalled = false;
  for (int i = 0; i < 40 && !stalled; ++i) {
    if (!manager.switchTo("odd", type).success) continue;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stalled = refused(manager.switchTo("ptp", type), {"odd", "not returned"});
  }
  EXPECT_TRUE(stalled);
  EXPECT_TRUE(manager.setSpeedScale(0.5).success);
  std::vector<std::string> ids, types;
  manager.list(ids, types);
  EXPECT_EQ(ids.size(), 2u);
  bool switched = false;
  for (int i = 0; i < 40 && !switched; ++i) switched = manager.switchTo("ptp", type).success;
  EXPECT_TRUE(switched);
  stop = true;
  robot.join();
  thread.stop();
}

/// Notes in which cycles it runs.
class Probe : public ctrl_more::FeedbackController {
 public:
  explicit Probe(bool& ran) : ran_(ran) {}
  ctrl_more::Description describe() const override {
    ctrl_more::Description description;
    description.type = "Probe";
    description.summary = "notes in which cycles it runs";
    description.modifies(ctrl_more::ControlContainer::TaskSpaceReferencePose, "ee")
        .in("m, quaternion x y z w")
        .frameOf("base")
        .about("left as it is");
    return description;
  }
  void initialize(ctrl_more::Setup&) override {}
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates&) override {
    ran_ = true;
  }

 private:
  bool& ran_;
};

TEST(Manager, RefusesLimitsOfOtherJointsThanTheRobotDescriptionHas) {
  coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  std::swap(limits.names[1], limits.names[2]);
  try {
    readManagerSettings(YAML::Load("{" + kTypes + "}"),
                        readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits,
                        false);
    ADD_FAILURE() << "accepted";
  } catch (const std::runtime_error& error) {
    for (const char* const name : {"joint 2", "lwr_base_link", "'lwr_a2'"}) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  }
}

TEST(Manager, MotionAndItsFeedbackProfileBeginInTheSameCycle) {
  const coglab_rt::JointLimits limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{" + kTypes + "}"), readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"),
      limits, false);
  settings.logger = &logger;
  settings.cycle.overrun_time = 0.0;
  ControllerManager manager(std::move(settings));
  bool ran = false;
  ctrl_more::ControllerEntry entry;
  entry.blend_s = 0.0;
  ASSERT_TRUE(manager.feedback().addController(std::make_unique<Probe>(ran), "probe", entry).ok());
  ASSERT_TRUE(manager.feedback().setProfile("dmp", {"probe"}).ok());
  ASSERT_TRUE(manager.feedback().setProfile("ptp", {}).ok());
  std::atomic<bool> stop{false};
  std::atomic<int> with{0}, without{0}, apart{0};
  std::thread control([&] {
    RobotSample sample;
    sample.position = kHome;
    sample.commanded_position = sample.position;
    sample.block = MotionBlock::None;
    VelocityCommand command;
    while (!stop) {
      ++sample.sequence;
      sample.stamp_ns = manager.now_ns();
      ran = false;
      manager.cycle().run(sample, 0.005, command);
      const bool dmp = std::string(manager.report().active.c_str()) == "dmp";
      ++(ran ? with : without);
      if (ran != dmp) ++apart;
    }
  });
  EXPECT_TRUE(VirtualRobot::ok(manager.load("dmp", "coglab/DmpController")));
  EXPECT_TRUE(VirtualRobot::ok(manager.load("ptp", "coglab/PtpController")));
  std::string type;
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(VirtualRobot::ok(manager.switchTo(i % 2 == 0 ? "dmp" : "ptp", type)));
  }
  EXPECT_EQ(manager.profile(), "ptp");
  stop = true;
  control.join();
  EXPECT_GT(with.load(), 100);
  EXPECT_GT(without.load(), 100);
  EXPECT_EQ(apart.load(), 0);
}

}  // namespace
}  // namespace coglab_controllers
