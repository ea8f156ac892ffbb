#include <array>
#include <cstdio>
#include <cstdlib>

#include <unistd.h>

#include "ctrl_more/central_module.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

/// A manager of another kind: walks forward by a step length per cycle and writes the pelvis.
class LocomotionStandIn : public Manager {
 public:
  LocomotionStandIn(std::string name, double step) : name_(std::move(name)), step_(step) {}
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle&) noexcept override {}
  void updateStage(Stage stage, const RobotStates&, ControlStates& control) noexcept override {
    if (stage != Stage::Task) return;
    const ControlSignal zmp = control.find(ControlContainer::Zmp, "zmp");
    control.view(zmp)[0] = step_ * ++steps_;
  }

 private:
  std::string name_;
  double step_;
  int steps_ = 0;
};

const bool registered = CentralModule::registerManager(
    "LocomotionStandIn",
    [](const std::string& name, const ConfigNode& block, RobotStates&, ControlStates&, Logger*) {
      block.requireKeys("manager '" + name + "'", {"type", "step_length"});
      return std::make_unique<LocomotionStandIn>(name,
                                                 block.find("step_length")->number("step_length"));
    });

struct CentralModuleTest : ::testing::Test {
  Logger logger;
  CentralModuleTest() {
    setenv("CTRL_MORE_PATH", CTRL_MORE_PLUGIN_DIR ":" CTRL_MORE_TEST_PLUGIN_DIR, 1);
  }
  ~CentralModuleTest() override { unsetenv("CTRL_MORE_PATH"); }
  std::string errorOf(const std::string& yaml) {
    try {
      CentralModule module(ConfigNode::fromText(yaml, "central.yaml"), "", &logger);
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "";
  }
};

TEST_F(CentralModuleTest, LocomotionRunsBeforeFeedback) {
  ASSERT_TRUE(registered);
  const std::string list = ::testing::TempDir() + "/central_list.yaml";
  std::FILE* file = std::fopen(list.c_str(), "w");
  std::fputs("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: true}\n", file);
  std::fclose(file);
  const std::string both =
      "locomotion: {type: LocomotionStandIn, step_length: 0.5}\n"
      "feedback: {type: Feedback, blend_s: 0, listFile: " +
      list + "}\n";
  CentralModule module(ConfigNode::fromText("managers: [locomotion, feedback]\n" + both, "c.yaml"),
                       "", &logger);
  ASSERT_TRUE(module.loadErrors().empty()) << module.loadErrors().front();
  EXPECT_EQ(module.managers(), (std::vector<std::string>{"locomotion", "feedback"}));
  module.update({5000000, 0.005, 1});
  EXPECT_EQ(module.controlStates().getZMP()[0], 1.5) << "0.5 written, then 1 added";
  module.update();
  EXPECT_EQ(module.controlStates().getZMP()[0], 2.0);
  EXPECT_EQ(module.manager("locomotion").name(), "locomotion");
  EXPECT_THROW(module.manager("locomotio"), std::invalid_argument);

  CentralModule other_way(
      ConfigNode::fromText("managers: [feedback, locomotion]\n" + both, "c.yaml"), "", &logger);
  other_way.update({5000000, 0.005, 1});
  EXPECT_EQ(other_way.controlStates().getZMP()[0], 0.5) << "the user's order decides";
}

TEST_F(CentralModuleTest, UserCodeOfThePaper) {
  CentralModule locomotor(CTRL_MORE_SOURCE_DIR "/examples/central.yaml", &logger);
  ASSERT_TRUE(locomotor.loadErrors().empty()) << locomotor.loadErrors().front();
  ASSERT_TRUE(locomotor.feedbackControllers().enable("Attitude"));
  RobotStates robot_state(&logger);
  ControlStates control_state(0, 0.005, &logger);
  robot_state.setMeasuredData("imu", vectorOf({0.1, -0.05, 0, 0, 0, 0, 0, 0, 9.81}), 0);
  ASSERT_TRUE(locomotor.update(robot_state, &control_state));
  // Half of the error about roll and pitch, nothing about yaw.
  const Eigen::Vector3d error = -logOf(fromRollPitchYaw(0.1, -0.05, 0));
  const Eigen::Vector3d expected(0.5 * error.x(), 0.5 * error.y(), 0.0);
  const Eigen::Matrix3d pelvis = control_state.getPelvisOrientation();
  EXPECT_LT((pelvis - expOf(expected).toRotationMatrix()).norm(), 1e-12);
}

TEST_F(CentralModuleTest, ExampleProgramPrintsTheSame) {
  ASSERT_EQ(access(CTRL_MORE_EXAMPLE, X_OK), 0) << "build " CTRL_MORE_EXAMPLE ", which is tested";
  const std::string command =
      CTRL_MORE_EXAMPLE " " CTRL_MORE_SOURCE_DIR "/examples/central.yaml 2>/dev/null";
  std::FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::array<double, 9> m{};
  int read = 0;
  for (double& value : m) read += std::fscanf(pipe, "%lf", &value);
  ASSERT_EQ(pclose(pipe), 0);
  ASSERT_EQ(read, 9);
  EXPECT_NEAR(m[5], 0.0499636, 1e-6);
}

TEST_F(CentralModuleTest, WrongFilesAreRefused) {
  EXPECT_TRUE(contains(errorOf("managers: [a]\n"), "no block 'a:'"));
  EXPECT_TRUE(contains(errorOf("managers: [a]\na: {type: Feedbak}\n"), "did you mean 'Feedback'"));
  EXPECT_TRUE(contains(errorOf("managers: [a]\na: {}\n"), "needs a type"));
  EXPECT_TRUE(contains(errorOf("managers: [a, a]\na: {type: Feedback}\n"), "twice"));
  EXPECT_TRUE(
      contains(errorOf("managers: [a, b]\na: {type: Feedback}\nb: {type: Feedback}\n"), "already"));
  EXPECT_TRUE(contains(errorOf("managers: []\njoints: 1.5\n"), "whole number"));
  EXPECT_TRUE(contains(errorOf("managers: []\nperiod: 0\n"), "period"));
  EXPECT_TRUE(contains(errorOf("managers: []\nperiods: 0\n"), "did you mean 'period'"));
  EXPECT_TRUE(contains(errorOf("- a\n"), "map"));
  EXPECT_TRUE(contains(errorOf("managers: [a]\na: {type: Feedback, listFile: nowhere.yaml}\n"),
                       "listFile"));
  CentralModule empty(ConfigNode::fromText("managers: []\n", "c"), "", &logger);
  EXPECT_THROW(empty.feedbackControllers(), std::logic_error);
  EXPECT_FALSE(empty.update(RobotStates(&logger), nullptr));
  EXPECT_FALSE(CentralModule::registerManager("Feedback", nullptr));
}

TEST_F(CentralModuleTest, StatesThatDoNotFitAreRefused) {
  CentralModule module(ConfigNode::fromText("managers: []\njoints: 7\n", "c"), "", &logger);
  ControlStates six(6, 0.005, &logger);
  six.setJointSpaceReference("Velocity", Eigen::VectorXd::Zero(6));
  EXPECT_FALSE(module.update(RobotStates(&logger), &six));
}

/// Records its cycles.
struct Watcher : Manager {
  std::string name_ = "watcher";
  std::vector<Cycle>* cycles;
  explicit Watcher(std::vector<Cycle>* list) : cycles(list) {}
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle& cycle) noexcept override { cycles->push_back(cycle); }
  void updateStage(Stage, const RobotStates&, ControlStates&) noexcept override {}
};

TEST_F(CentralModuleTest, CountsItsCyclesAndTakesTimeFromTheStates) {
  static std::vector<Cycle> cycles;
  const auto maker = [](const std::string&, const ConfigNode&, RobotStates&, ControlStates&,
                        Logger*) { return std::make_unique<Watcher>(&cycles); };
  ASSERT_TRUE(CentralModule::registerManager("Watcher", maker));
  EXPECT_FALSE(CentralModule::registerManager("Watcher", maker)) << "known already";
  EXPECT_FALSE(CentralModule::registerManager("Feedback", maker)) << "known from the start";
  EXPECT_FALSE(CentralModule::registerManager("Unmade", nullptr));
  CentralModule module(
      ConfigNode::fromText("managers: [w]\nperiod: 0.002\nw: {type: Watcher}\n", "c"), "", &logger);
  module.robotStates().setMeasuredData("imu", vectorOf({1.0}), 55);
  module.update();
  module.update();
  module.update({99, 0.01, 7});
  module.update();
  ASSERT_EQ(cycles.size(), 4u);
  const std::uint64_t numbers[4] = {1, 2, 7, 8};
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(cycles[i].number, numbers[i]);
    EXPECT_EQ(cycles[i].now_ns, i == 2 ? 99 : 55);
    EXPECT_EQ(cycles[i].dt, i == 2 ? 0.01 : 0.002);
  }
}

TEST_F(CentralModuleTest, EverySignalOfTheUserGoesInAndComesOut) {
  CentralModule module(ConfigNode::fromText("managers: []\n", "c"), "", &logger);
  RobotStates robot(&logger);
  robot.setMeasuredData("imu", vectorOf({1, 2}), 3);
  robot.setEstimatedData("zmp", vectorOf({4, 5, 6}), 7);
  robot.declare(RobotSource::Measured, "later", 2);  // not written yet: nothing to copy
  ControlStates control(0, 0.005, &logger);
  const Eigen::VectorXd pose = vectorOf({1, 2, 3, 0, 0, 1, 0});
  control.setTaskSpaceReferencePose("ee", pose);
  control.setOtherReference("horizon", vectorOf({7, 8}));
  control.setJointSpaceReference("Torque", vectorOf({9}));
  ASSERT_TRUE(module.update(robot, &control));
  Eigen::VectorXd value;
  std::int64_t stamp = 0;
  ASSERT_TRUE(module.robotStates().getMeasuredData("imu", value, stamp));
  EXPECT_EQ(value, vectorOf({1, 2}));
  EXPECT_EQ(stamp, 3);
  ASSERT_TRUE(module.robotStates().getEstimatedData("zmp", value, stamp));
  EXPECT_EQ(value, vectorOf({4, 5, 6}));
  EXPECT_EQ(stamp, 7);
  ASSERT_TRUE(module.controlStates().getTaskSpaceReferencePose("ee", value));
  EXPECT_EQ(value, pose);
  ASSERT_TRUE(module.controlStates().getOtherReference("horizon", value));
  EXPECT_EQ(value, vectorOf({7, 8}));
  ASSERT_TRUE(control.getJointSpaceReference("Torque", value));
  EXPECT_EQ(value, vectorOf({9}));
  // A robot signal that changes its size is refused, and nothing is run.
  RobotStates other(&logger);
  other.setMeasuredData("imu", vectorOf({1, 2, 3}), 4);
  EXPECT_FALSE(module.update(other, &control));
}

/// Writes the pelvis, from the third cycle on with a NaN.
struct Broken : Manager {
  std::string name_ = "broken";
  int cycles = 0;
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle&) noexcept override { ++cycles; }
  void updateStage(Stage, const RobotStates&, ControlStates& control) noexcept override {
    auto com = control.view(control.find(ControlContainer::CentreOfMass, "com"));
    com[0] = cycles;
    com[1] = cycles < 3 ? 0.0 : std::nan("");
  }
};

TEST_F(CentralModuleTest, ManagerThatWritesNoNumberIsUndoneAndOff) {
  ASSERT_TRUE(CentralModule::registerManager(
      "Broken", [](const std::string&, const ConfigNode&, RobotStates&, ControlStates&, Logger*) {
        return std::make_unique<Broken>();
      }));
  CentralModule module(ConfigNode::fromText("managers: [b]\nb: {type: Broken}\n", "c"), "",
                       &logger);
  for (int i = 0; i < 5; ++i) module.update();
  EXPECT_EQ(module.controlStates().getCoM()[0], 2.0);
  EXPECT_EQ(module.controlStates().getCoM()[1], 0.0);
}

TEST_F(CentralModuleTest, RobotHostsItOnItsOwnStores) {
  RobotStates robot(&logger);
  ControlStates control(7, 0.005, &logger);
  const auto refusal = [&](const std::string& text) -> std::string {
    try {
      CentralModule(ConfigNode::fromText(text, "c"), kPlugins, {robot, control, {}, {}}, &logger);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  const std::string feedback = "managers: [f]\nf: {type: Feedback}\n";
  EXPECT_EQ(refusal(feedback + "joints: 7\n"), "");
  EXPECT_TRUE(contains(refusal(feedback + "joints: 6\n"), "7 joints"));
  EXPECT_TRUE(contains(refusal(feedback + "period: 0.01\n"), "period is 0.005"));
  EXPECT_TRUE(contains(refusal("managers: []\n"), "type Feedback"));
  CentralModule module(ConfigNode::fromText("managers: [walk, f]\nf: {type: Feedback}\n"
                                            "walk: {type: Walk, step: 0.5}\n",
                                            "c"),
                       kPlugins, {robot, control, {}, {}}, &logger);
  module.begin({1, 0.005, 1});
  module.run(Stage::Task);
  EXPECT_EQ(control.getCoM()[0], 0.5);
  module.end();
}

TEST_F(CentralModuleTest, ManagersComeFromLibraries) {
  const auto make = [&](const std::string& block) {
    return CentralModule(
        ConfigNode::fromText("managers: [walk]\nwalk: {" + block + "}\n", "central.yaml"), kPlugins,
        &logger);
  };
  const auto refusal = [&](const std::string& block) -> std::string {
    try {
      make(block);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_TRUE(contains(refusal("type: Walk, libPath: libwalk.so"), "needs a step"));
  EXPECT_TRUE(contains(refusal("type: Wlk, libPath: libwalk.so"), "did you mean 'Walk'"));
  EXPECT_TRUE(contains(refusal("type: Walk, libPath: libgood.so"), "registers no manager"));
  EXPECT_TRUE(contains(refusal("type: Walk, libPath: libnowhere.so"), "libnowhere.so"));
  EXPECT_TRUE(contains(refusal("type: Walk"), "needs a step")) << "found by the name of the type";
  CentralModule central = make("type: Walk, libPath: libwalk.so, step: 0.5");
  central.update();
  central.update();
  EXPECT_EQ(central.controlStates().getCoM()[0], 1.0);
}

}  // namespace
}  // namespace ctrl_more
