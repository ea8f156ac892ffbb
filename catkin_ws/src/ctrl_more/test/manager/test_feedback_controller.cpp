#include <fstream>
#include <sstream>
#include <type_traits>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(FeedbackControllerTest, DocumentationMethodsWithoutAManager) {
  TestController c;
  c.description.information = "more";
  c.description.gain("kp", 2.0).in("1").about("gain");
  EXPECT_TRUE(c.setName("mine"));
  EXPECT_EQ(c.getName(), "mine");
  EXPECT_FALSE(c.setName(""));
  EXPECT_TRUE(c.addUsedControlState("pelvis"));
  EXPECT_TRUE(c.addUsedControlState("taskSpaceReferencePose/ee"));
  EXPECT_TRUE(c.addUsedRobotState("imu"));
  EXPECT_TRUE(c.addUsedRobotState("estimatedData/zmp"));
  EXPECT_FALSE(c.addUsedRobotState(""));
  const Status status = c.addUsedControlState("pelvs");
  EXPECT_TRUE(contains(status.message(), "did you mean 'pelvis'")) << status.message();
  EXPECT_TRUE(c.isUsingRobotState("imu"));
  EXPECT_TRUE(c.isUsingRobotState("estimatedData/zmp"));
  EXPECT_FALSE(c.isUsingRobotState("measuredData/zmp"));
  EXPECT_TRUE(c.isUsingControlState("ee"));
  EXPECT_TRUE(c.isUsingControlState("pelvisOrientation/pelvis"));
  EXPECT_FALSE(c.isUsingControlState("com"));
  EXPECT_EQ(c.getUsedControlState().size(), 2u);
  EXPECT_EQ(c.getUsedControlStates().size(), 2u);
  EXPECT_EQ(c.getUsedRobotStates().size(), 2u);
  EXPECT_EQ(c.getGains().at("kp"), std::vector<double>{2.0});
  EXPECT_EQ(c.getInformation(), "more");
}

TEST(FeedbackControllerTest, ControlMethodsWithoutAManager) {
  TestController c;
  c.description.gain("kp", 2.0).range(0, 10).in("1").about("gain");
  EXPECT_FALSE(c.isEnabled());
  EXPECT_FALSE(c.isPaused());
  c.enable();
  c.pause();
  EXPECT_TRUE(c.isEnabled());
  EXPECT_TRUE(c.isPaused());
  c.resume();
  c.disable();
  EXPECT_FALSE(c.isEnabled());
  EXPECT_FALSE(c.isPaused());
  EXPECT_TRUE(c.setGains({{"kp", {3.0}}}));
  EXPECT_FALSE(c.setGains({{"kp", {11.0}}}));
  EXPECT_FALSE(c.setGains({{"kq", {1.0}}}));
  EXPECT_EQ(c.getGains().at("kp"), std::vector<double>{3.0});
  EXPECT_FALSE(c.loadGains("/nowhere/gains.yaml"));
}

TEST(FeedbackControllerTest, ControlMethodsGoToTheManager) {
  Rig rig;
  TestController* c = rig.add(adder("pose", "ee", 0.1), "a", false);
  c->enable();
  EXPECT_TRUE(rig.manager->isEnabled("a"));
  c->pause();
  EXPECT_TRUE(rig.manager->isPaused("a"));
  EXPECT_TRUE(c->isPaused());
  c->resume();
  EXPECT_FALSE(c->isPaused());
  c->disable();
  EXPECT_FALSE(rig.manager->isEnabled("a"));
  EXPECT_FALSE(c->setName("b")) << "names come from the manager";
  EXPECT_FALSE(c->addUsedRobotState("imu")) << "too late";
  EXPECT_FALSE(c->addUsedControlState("zmp")) << "too late";
}

TEST(FeedbackControllerTest, DeclarationSurvivesLoading) {
  Rig rig;
  auto controller = adder("pose", "ee", 0.1);
  controller->description.measured("imu").size(9).in("rad").frameOf("imu").about("imu");
  controller->addUsedControlState("zmp");
  TestController* c = rig.add(std::move(controller), "a");
  ASSERT_EQ(c->getUsedControlStates().size(), 2u);
  EXPECT_EQ(c->getUsedControlStates()[0].signal.size(), 7);
  ASSERT_EQ(c->getUsedRobotStates().size(), 1u);
  EXPECT_EQ(c->getUsedRobotStates()[0].signal.size(), 9);
  EXPECT_EQ(rig.manager->getUsedControlStates(),
            (std::vector<std::string>{"taskSpaceReferencePose/ee", "zmp/zmp"}));
  EXPECT_EQ(rig.manager->getUsedRobotStates(), std::vector<std::string>{"measuredData/imu"});
  rig.manager->disable("a");
  EXPECT_TRUE(rig.manager->getUsedControlStates(true).empty());
}

TEST(FeedbackControllerTest, InitializeIsCalledOnceAndMayRefuse) {
  Rig rig;
  int calls = 0;
  auto c = adder("pose", "ee", 0.1);
  c->on_initialize = [&calls](TestController& self, ctrl_more::Setup& setup) {
    ++calls;
    self.out = setup.modify("ee");
  };
  EXPECT_EQ(calls, 0) << "not by a constructor";
  rig.add(std::move(c), "a");
  rig.step(3);
  rig.manager->disable("a");
  rig.step();
  rig.manager->enable("a");
  rig.step();
  EXPECT_EQ(calls, 1);
  auto refusing = adder("pose", "ee", 0.1);
  refusing->on_initialize = [](TestController&, ctrl_more::Setup&) {
    throw std::runtime_error("no such camera");
  };
  const Status status = rig.manager->addController(std::move(refusing), "b");
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "no such camera")) << status.message();
  EXPECT_FALSE(rig.manager->has("b"));
}

TEST(FeedbackControllerTest, RequestingAnUndeclaredSignalIsRefused) {
  Rig rig;
  for (int what = 0; what < 5; ++what) {
    auto c = adder("pose", "ee", 0.1);
    c->description.reads(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("read only");
    c->on_initialize = [what](TestController&, ctrl_more::Setup& setup) {
      if (what == 0) setup.modify("pelvis");
      if (what == 1) setup.modify("zmp");
      if (what == 2) setup.read("imu");
      if (what == 3) setup.gain("kp");
      if (what == 4) setup.modify("ee", 6);
    };
    const Status status = rig.manager->addController(std::move(c), "c" + std::to_string(what));
    EXPECT_FALSE(status) << what;
    EXPECT_FALSE(status.message().empty());
  }
  EXPECT_TRUE(rig.manager->getControllersNames().empty());
}

TEST(FeedbackControllerTest, PlotShowsEverything) {
  Rig rig;
  auto c = adder("pose", "ee", 0.1);
  c->description.measured("imu").size(9).in("rad").frameOf("imu_link").maxAge(0.05);
  c->description.gain("kp", 0).vector(2, 1.5).range(0, 10).in("1").about("gain");
  c->description.information = "written for a test";
  rig.add(std::move(c), "a");
  rig.manager->pause("a");
  std::ostringstream out;
  rig.manager->plot("a", out);
  EXPECT_EQ(out.str(),
            "a (TestController, task stage)\n"
            "  adds to a reference\n"
            "  enabled: yes, paused: yes, safety: no\n"
            "  robot states:\n"
            "    measuredData/imu [9] (rad) in imu_link, age 50 ms\n"
            "  control states:\n"
            "    taskSpaceReferencePose/ee [7] (m) in base, modified\n"
            "  gains:\n"
            "    kp = [1.5, 1.5] 1 (0 to 10)\n"
            "  written for a test\n");
  std::ostringstream all;
  rig.manager->plotAll(all);
  EXPECT_EQ(all.str(), out.str());
}

template <int N>
std::string refusalOf(const std::string& role, bool reads) {
  Rig rig;
  rig.robot.declare(RobotSource::Measured, "imu", 9);
  auto c = std::make_unique<TestController>();
  c->description.measured("imu").in("rad").frameOf("imu").about("any size");
  c->description.reads(ControlContainer::CentreOfMass, "com").in("m").frameOf("w").about("read");
  c->description.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("moved");
  c->on_initialize = [&](TestController&, Setup& setup) {
    if (role == "imu")
      setup.read<N>(role);
    else if (reads)
      setup.reference<N>(role);
    else
      setup.modify<N>(role);
  };
  return rig.manager->addController(std::move(c), "c").message();
}

TEST(Handles, SizesAreComparedWhenTheyAreFetched) {
  EXPECT_TRUE(contains(refusalOf<7>("zmp", false), "size 7")) << refusalOf<7>("zmp", false);
  EXPECT_TRUE(contains(refusalOf<2>("com", true), "size 2"));
  EXPECT_TRUE(contains(refusalOf<10>("imu", true), "expects 10"));
  EXPECT_EQ(refusalOf<3>("zmp", false), "");
  EXPECT_EQ(refusalOf<3>("com", true), "");
  EXPECT_EQ(refusalOf<9>("imu", true), "");
  EXPECT_TRUE(contains(refusalOf<3>("com", false), "read only"));
}

TEST(Handles, NothingBesideASignalIsWritten) {
  using Way = std::function<void(Numbers<> any, Numbers<3> three)>;
  const std::vector<Way> ways = {
      [](Numbers<> any, Numbers<3>) { any[3] = 9.0; },
      [](Numbers<>, Numbers<3> three) { three[3] = 9.0; },
      [](Numbers<>, Numbers<3> three) { three[-1] = 9.0; },
      [](Numbers<> any, Numbers<3>) { any(7) = 9.0; },
      [](Numbers<> any, Numbers<3>) { any.head<4>().setConstant(9.0); },
      [](Numbers<> any, Numbers<3>) { any.tail(4).setConstant(9.0); },
      [](Numbers<> any, Numbers<3>) { any.segment<2>(2).setConstant(9.0); },
      [](Numbers<>, Numbers<3> three) { three.segment(1, 3).setConstant(9.0); },
      [](Numbers<> any, Numbers<3>) { any.head(2)[2] = 9.0; },
      [](Numbers<> any, Numbers<3>) { any = Eigen::VectorXd::Constant(5, 9.0); },
      [](Numbers<> any, Numbers<3>) { any += Eigen::VectorXd::Constant(5, 9.0); },
      [](Numbers<> any, Numbers<3>) { any -= Eigen::VectorXd::Constant(2, 9.0); },
      [](Numbers<>, Numbers<3> three) { three = Eigen::VectorXd::Constant(5, 9.0); },
      [](Numbers<> any, Numbers<3>) { any = Eigen::MatrixXd::Constant(3, 2, 9.0); },
      [](Numbers<> any, Numbers<3>) { any = any.head(2); },
  };
  for (std::size_t i = 0; i < ways.size(); ++i) {
    Rig rig(0.0, false, false);
    auto c = std::make_unique<TestController>();
    c->description.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("moved");
    Modify<3> three;
    c->on_initialize = [&three](TestController& self, ctrl_more::Setup& setup) {
      self.out = setup.modify("zmp");
      three = setup.modify<3>("zmp");
    };
    c->on_write = [&](TestController& self, ModifiedControlStates& modified) {
      ways[i](modified[self.out], modified[three]);
    };
    rig.add(std::move(c), "c");
    rig.setReferences();
    const std::vector<double> before(rig.control.data(),
                                     rig.control.data() + rig.control.dataSize());
    rig.step();
    const std::string fault = rig.manager->status("c").fault_text;
    EXPECT_TRUE(contains(fault, "zmp/zmp") && contains(fault, "expected")) << i << ": " << fault;
    EXPECT_EQ(before,
              std::vector<double>(rig.control.data(), rig.control.data() + rig.control.dataSize()));
  }
}

template <typename T, typename = void>
constexpr bool kShifts = false;
template <typename T>
constexpr bool kShifts<T, std::void_t<decltype(std::declval<T&>() << 1.0)>> = true;
template <typename T>
constexpr bool kLvalue = (std::decay_t<T>::Flags & Eigen::LvalueBit) != 0;

/// Eigen's unchecked ways of writing do not compile or have no effect.
TEST(Handles, NothingElseOfEigenWrites) {
  using Three = Numbers<3>;
  static_assert(kShifts<Eigen::Vector3d> && !kShifts<Three> && !kShifts<Numbers<>>);
  static_assert(kLvalue<decltype(std::declval<Eigen::Vector3d&>().topRows(2))>);
  static_assert(!kLvalue<Three> && !kLvalue<decltype(std::declval<Three&>().topRows(2))> &&
                !kLvalue<decltype(std::declval<Three&>().bottomRows<2>())> &&
                !kLvalue<decltype(std::declval<Three&>().middleRows(0, 2))> &&
                !kLvalue<decltype(std::declval<Three&>().block(0, 0, 2, 1))> &&
                !kLvalue<decltype(std::declval<Three&>().row(0))> &&
                !kLvalue<decltype(std::declval<Three&>().array())> &&
                !kLvalue<decltype(std::declval<Three&>().matrix())> &&
                !kLvalue<decltype(std::declval<Three&>().transpose())> &&
                !kLvalue<decltype(std::declval<Three&>().reverse())>);
  static_assert(!std::is_assignable_v<decltype(std::declval<Three&>().coeffRef(0)), double>);
  static_assert(!std::is_assignable_v<decltype(std::declval<Three&>().x()), double>);
  static_assert(!std::is_assignable_v<decltype(*std::declval<Three&>().data()), double>);
  double numbers[4] = {1.0, 2.0, 3.0, 4.0};
  Three three(numbers, 3);
  three = three + Eigen::Vector3d::UnitX();
  three.head<2>() += Eigen::Vector2d(0.5, 0.5);
  three.tail(1) /= 2.0;
  EXPECT_EQ(std::vector<double>(numbers, numbers + 4), (std::vector<double>{2.5, 2.5, 1.5, 4.0}));
  EXPECT_EQ(three.norm(), Eigen::Vector3d(2.5, 2.5, 1.5).norm());
}

TEST(Handles, EmptyOnesAreFaults) {
  Rig rig(0.0, false, false);
  auto c = adder("com", "com", 1.0);
  int way = 0;
  c->on_update = [&way](TestController&, const Cycle&, const RobotStates& robot,
                        const ControlStates& original, ModifiedControlStates& modified) {
    if (way == 0) static_cast<void>(robot.view(Read<3>()));
    if (way == 1) static_cast<void>(original.view(Reference<7>()));
    if (way == 2) static_cast<void>(original.view(Modify<>()));
    if (way == 3) modified[Modify<6>()][5] = 1.0;
  };
  rig.add(std::move(c), "c");
  for (; way < 4; ++way) {
    rig.step();
    EXPECT_EQ(rig.manager->status("c").fault, FaultKind::Exception) << way;
    rig.manager->resume("c", "fault");
  }
}

}  // namespace
}  // namespace ctrl_more
