// What holds where nothing is said: the documented values of options, states and handles.
#include "ctrl_more/central_module.hpp"
#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/loading/prototypes.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(Defaults, OfAManager) {
  const ManagerOptions options;
  EXPECT_EQ(options.blend_s, 0.2);
  EXPECT_FALSE(options.timed);
  EXPECT_FALSE(options.lockstep);
  EXPECT_EQ(options.overruns_to_pause, 5);
  EXPECT_FALSE(options.check_undeclared);
  const ControllerEntry entry;
  EXPECT_FALSE(entry.enabled);
  EXPECT_EQ(entry.overrun_us, 0.0);
  EXPECT_LT(entry.blend_s, 0.0) << "that of the manager";
  EXPECT_EQ(entry.on_fault, StopPolicy::Fade);
  Logger logger;
  RobotStates robot(&logger);
  ControlStates control(0, 0.005, &logger);
  const FeedbackControllersManager manager(robot, control, {}, &logger);
  EXPECT_EQ(manager.options().blend_s, 0.2);
  EXPECT_EQ(manager.name(), "feedback");
  EXPECT_EQ(manager.lastCycle().cycle, 0u) << "no cycle has run";
}

TEST(Defaults, OfWhatIsToldOfAController) {
  const ControllerStatus status;
  EXPECT_FALSE(status.enabled || status.paused || status.safety);
  EXPECT_EQ(status.activity, Activity::Off);
  EXPECT_EQ(status.fault, FaultKind::None);
  EXPECT_EQ(status.fault_cycle, 0u);
  EXPECT_EQ(status.faults, 0u);
  EXPECT_EQ(status.overruns, 0u);
  EXPECT_EQ(status.last_us, 0.0);
  const Attribution change;
  EXPECT_EQ(change.cycle, 0u);
  EXPECT_EQ(change.size, 0.0);
  EXPECT_EQ(change.angle, 0.0);
  EXPECT_EQ(CycleRecord().cycle, 0u);
  ControllerPlot plot;
  plot.name = "a";
  EXPECT_TRUE(contains(plotText(plot), "enabled: no, paused: no, safety: no")) << plotText(plot);
}

TEST(Defaults, OfACycle) {
  const Cycle cycle;
  EXPECT_EQ(cycle.now_ns, 0);
  EXPECT_EQ(cycle.dt, 0.005);
  EXPECT_EQ(cycle.number, 0u);
  EXPECT_EQ(kStages, 2);
  EXPECT_EQ(kRobotSources, 2);
}

TEST(Defaults, OfStores) {
  const ControlStates control;
  EXPECT_EQ(control.joints(), 0);
  EXPECT_EQ(control.controlPeriod(), 0.005);
  Logger logger;
  CentralModule module(ConfigNode::fromText("managers: []\n", "c"), "", &logger);
  EXPECT_EQ(module.controlStates().joints(), 0);
  EXPECT_EQ(module.controlStates().controlPeriod(), 0.005);
}

TEST(Defaults, HandlesThatWereNeverFetchedAreEmpty) {
  EXPECT_FALSE(ControlSignal().valid());
  EXPECT_EQ(ControlSignal().size(), 0);
  EXPECT_EQ(ControlSignal().offset(), 0);
  EXPECT_EQ(RobotSignal().index(), 0u);
  EXPECT_FALSE(Read<3>().valid());
  EXPECT_FALSE(Reference<3>().valid());
  EXPECT_FALSE(Modify<3>().valid());
  EXPECT_EQ(Gain().size(), 0);
  EXPECT_EQ(SignalInfo().size, 0u);
  EXPECT_EQ(SignalInfo().offset, 0u);
  EXPECT_EQ(kNeverWritten, -1);
  EXPECT_EQ(ConfigNode().line(), 0);
  EXPECT_EQ(ConfigNode().kind(), ConfigNode::Kind::Empty);
  EXPECT_EQ(Twist, 6);
  EXPECT_EQ(Wrench, 6);
  EXPECT_EQ(Pose, 7);
}

TEST(Defaults, NoStepOfAChangeIsForcedUnlessAsked) {
  const Change change = Change()
                            .enable("a")
                            .disable("a")
                            .pause("a")
                            .resume("a")
                            .bySignal(Change::Kind::Pause, Change::Who::UsingRobotState, "imu")
                            .order({"a"})
                            .gains("a", {})
                            .gainFile("a", "f")
                            .profile("p")
                            .motionSwitched();
  ASSERT_EQ(change.steps().size(), 10u);
  for (const Change::Step& step : change.steps()) EXPECT_FALSE(step.force);
  EXPECT_EQ(change.steps()[2].reason, "user");
  EXPECT_EQ(change.steps()[3].reason, "user");
  EXPECT_TRUE(Change().disable("a", true).steps()[0].force);
  EXPECT_TRUE(Change().pause("a", "r", true).steps()[0].force);
}

TEST(Defaults, OfADeclaration) {
  Description d;
  EXPECT_FALSE(d.safety);
  EXPECT_EQ(d.stage, Stage::Task);
  EXPECT_EQ(d.on_switch, SwitchPolicy::Reset);
  EXPECT_EQ(d.gain("k", 1.0).size, 1);
  EXPECT_FALSE(d.setting("n", std::vector<double>{1.0}).any_size);
  EXPECT_TRUE(d.setting("m", std::vector<double>{1.0}).anySize().any_size);
  const ControlSignalUse& read = d.reads(ControlContainer::Zmp, "zmp");
  EXPECT_FALSE(read.modifies || read.exclusive || read.if_asked);
  EXPECT_EQ(read.limit.size, kUnlimited);
  EXPECT_TRUE(d.modifies(ControlContainer::Zmp, "zmp").alone().exclusive);
  EXPECT_TRUE(d.measured("imu").ifAsked().if_asked);
}

TEST(Abi, TextShowsEveryNumberAndTheSizesThatThereAre) {
  Abi abi;
  EXPECT_EQ(abi.text(), "interface 0, compiler ABI 0, Eigen 0 aligned to 0, sizes");
  abi.interface = 4;
  abi.compiler_abi = 1017;
  abi.eigen = 30400;
  abi.eigen_align = 16;
  abi.sizes[0] = 1;
  abi.sizes[2] = 24;
  EXPECT_EQ(abi.text(), "interface 4, compiler ABI 1017, Eigen 30400 aligned to 16, sizes 1 24");
}

TEST(Abi, EigensVersionIsReadableInItsNumber) {
  const int eigen = thisAbi().eigen;
  EXPECT_EQ(eigen / 10000, EIGEN_WORLD_VERSION);
  EXPECT_EQ(eigen / 100 % 100, EIGEN_MAJOR_VERSION);
  EXPECT_EQ(eigen % 100, EIGEN_MINOR_VERSION);
  EXPECT_EQ(thisAbi().interface, 4) << "raised when classes or meanings change";
}

}  // namespace
}  // namespace ctrl_more
