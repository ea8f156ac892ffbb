// Options of each controller in a list file. A refused file leaves nothing loaded.
#include <fstream>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

struct ListFiles : ::testing::Test {
  Rig rig{0.0, false, false};
  LoadReport load(const std::string& yaml) {
    return rig.manager->load(ConfigNode::fromText(yaml, "list.yaml"), kPlugins);
  }
  // The whole refusal of one controller with this in its block.
  std::string refusalOf(const std::string& inside) {
    return load("loadControllers: [Good]\nGood: {libPath: libgood.so, " + inside + "}\n").text();
  }
};

TEST_F(ListFiles, EveryKeyOfABlockHasItsValues) {
  for (const char* good :
       {"on_fault: hold", "on_fault: fade", "on_fault: zero", "overrun_us: 0", "overrun_us: 0.5",
        "blend_s: 0", "blend_s: 0.5", "enabled: true", "enabled: false", "type: Good"}) {
    EXPECT_EQ(refusalOf(good), "") << good;
    ASSERT_TRUE(rig.manager->disable("Good"));
    ASSERT_TRUE(rig.manager->unload("Good")) << good;
  }
  EXPECT_TRUE(contains(refusalOf("on_fault: holds"), "did you mean 'hold'"));
  EXPECT_TRUE(contains(refusalOf("blend_s: -0.1"), "blend_s must"));
  EXPECT_TRUE(contains(refusalOf("overrun_us: -0.1"), "overrun_us must"));
  EXPECT_TRUE(contains(refusalOf("enabled: 1"), "true or false"));
  EXPECT_TRUE(contains(refusalOf("type: [a]"), "type expects"));
  EXPECT_TRUE(contains(refusalOf("configFile: [a]"), "configFile expects"));
  EXPECT_TRUE(contains(refusalOf("configFile: nowhere.yaml"), "configFile of 'Good'"));
  EXPECT_FALSE(rig.manager->has("Good"));
}

TEST_F(ListFiles, PythonClassesNeedAProgramWithPython) {
  EXPECT_TRUE(contains(refusalOf("type: 'mine:Mine'"), "has no libPath"));
  EXPECT_TRUE(
      contains(load("loadControllers: [a]\na: {type: 'mine:Mine'}\n").text(), "runs no Python"));
}

TEST_F(ListFiles, BlendTimeOfTheFileIsTheControllers) {
  ASSERT_EQ(refusalOf("enabled: true, blend_s: 0.02"), "");
  for (int i = 1; i <= 4; ++i) {
    rig.step();
    EXPECT_NEAR(rig.control.getZMP()[0], i / 4.0, 1e-12);
  }
}

TEST_F(ListFiles, RefusedControllersLeaveNoKeyInEitherStore) {
  auto c = std::make_unique<TestController>();
  c->description.measured("late").size(2).in("1").frameOf("w").about("x");
  c->description.modifies(ControlContainer::Zmp, "late").in("m").frameOf("w").about("x");
  c->on_initialize = [](TestController&, ctrl_more::Setup& setup) {
    setup.read("late");
    setup.modify("late");
    throw std::runtime_error("no");
  };
  EXPECT_FALSE(rig.manager->addController(std::move(c), "a"));
  EXPECT_FALSE(rig.robot.find(RobotSource::Measured, "late").valid());
  EXPECT_FALSE(rig.control.find(ControlContainer::Zmp, "late").valid());
}

TEST_F(ListFiles, PartsOfAProfileAreNotUnloaded) {
  ASSERT_EQ(refusalOf("enabled: false"), "");
  ASSERT_TRUE(rig.manager->setProfile("empty", {}));
  ASSERT_TRUE(rig.manager->setProfile("guided", {"Good"}));
  const Status status = rig.manager->unload("Good");
  EXPECT_EQ(status.cause(), Cause::Busy);
  EXPECT_TRUE(contains(status.message(), "'guided'")) << status.message();
  ASSERT_TRUE(rig.manager->setProfile("guided", {}));
  EXPECT_TRUE(rig.manager->unload("Good"));
}

}  // namespace
}  // namespace ctrl_more
