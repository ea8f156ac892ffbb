#include <fstream>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

std::string temporaryFile(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + "/" + name;
  std::ofstream(path) << text;
  return path;
}

struct WithGain : ::testing::Test {
  Rig rig{0.1};
  TestController* c = nullptr;
  WithGain() {
    auto made = adder("vel", "ee", 0.0);
    made->description.gain("kp", 1.0).range(0, 10).in("1").about("what is added");
    made->description.setting("mode", "fast").oneOf({"fast", "slow"}).about("a mode");
    made->on_initialize = [](TestController& self, ctrl_more::Setup& setup) {
      self.out = setup.modify("ee");
      self.gain_handle = setup.gain("kp");
    };
    made->on_write = [](TestController& self, ModifiedControlStates& modified) {
      modified[self.out][0] += self.scalar(self.gain_handle);
    };
    c = rig.add(std::move(made), "c");
    rig.step(40);
  }
};

TEST_F(WithGain, HotReloadBlendsIn) {
  EXPECT_EQ(rig.twist()[0], 1.0);
  const std::string file = temporaryFile("gains.yaml", "kp: 3\n");
  ASSERT_TRUE(rig.manager->loadGains("c", file));
  double last = 1.0;
  for (int i = 0; i < 20; ++i) {
    rig.step();
    EXPECT_NEAR(rig.twist()[0] - last, 0.1, 1e-12) << "2 in 0.1 s";
    last = rig.twist()[0];
  }
  EXPECT_EQ(rig.twist()[0], 3.0);
  rig.step();
  EXPECT_EQ(rig.twist()[0], 3.0);
  EXPECT_EQ(rig.manager->getGains("c").all().at("kp"), std::vector<double>{3.0});
  EXPECT_EQ(c->getGains().at("kp"), std::vector<double>{3.0});
}

TEST_F(WithGain, RefusedFilesLeaveTheOldGains) {
  for (const char* text : {"kp: 11\n", "kp: x\n", "kp: [1, 2]\n", "kq: 1\n", "kp: .nan\n", "[1]\n",
                           "kp: 2\nmode: slow\n", "kp: 2\ntype: Other\n", "kp: {a: 1}\n"}) {
    const Status status = rig.manager->loadGains("c", temporaryFile("bad.yaml", text));
    EXPECT_FALSE(status) << text;
    EXPECT_TRUE(contains(status.message(), "bad.yaml")) << status.message();
  }
  EXPECT_TRUE(contains(
      rig.manager->loadGains("c", temporaryFile("bad.yaml", "\n\nkq: 1\n")).message(), ":3:"));
  rig.step(40);
  EXPECT_EQ(rig.twist()[0], 1.0);
  EXPECT_FALSE(rig.manager->reloadGains("c")) << "it was loaded without a file";
  EXPECT_FALSE(rig.manager->setGains("c", {{"kp", {1, 2}}}));
}

TEST_F(WithGain, GainsChangedIsCalledBeforeEachUpdateWithNewGains) {
  double last = c->scalar(c->gain_handle);
  int told = c->gains_changes, changed = 0;
  c->on_write = [&](TestController& self, ModifiedControlStates&) {
    const double value = self.scalar(self.gain_handle);
    EXPECT_EQ(self.gains_changes - told, value == last ? 0 : 1) << last << " -> " << value;
    changed += value == last ? 0 : 1;
    last = value;
    told = self.gains_changes;
  };
  rig.step(5);
  EXPECT_EQ(changed, 0);
  ASSERT_TRUE(rig.manager->setGains("c", {{"kp", {2.0}}}));
  rig.step(40);
  EXPECT_EQ(changed, 20) << "blended in, in 0.1 s";
  EXPECT_EQ(last, 2.0);
  ASSERT_TRUE(rig.manager->loadGains("c", temporaryFile("told.yaml", "kp: 3\n")));
  rig.step(40);
  EXPECT_EQ(changed, 40);
  EXPECT_FALSE(rig.manager->setGains("c", {{"kp", {11.0}}}));
  rig.step(5);
  EXPECT_EQ(changed, 40) << "refused";
}

TEST_F(WithGain, TheInstanceForwardsToItsManager) {
  ASSERT_TRUE(c->setGains({{"kp", {4.0}}}));
  EXPECT_EQ(rig.manager->getGains("c").all().at("kp"), std::vector<double>{4.0});
  EXPECT_EQ(c->getGains().at("kp"), std::vector<double>{4.0}) << "as requested, not as blended";
  rig.step();
  EXPECT_NEAR(rig.twist()[0], 1.0 + 3.0 / 20, 1e-12);
  ASSERT_TRUE(c->loadGains(temporaryFile("instance.yaml", "kp: 2\n")));
  EXPECT_EQ(rig.manager->getGains("c").all().at("kp"), std::vector<double>{2.0});
  rig.step(40);
  EXPECT_EQ(rig.twist()[0], 2.0);
}

TEST_F(WithGain, AnEmptyFileNameDoesNotMeanItsOwnFile) {
  auto made = adder("vel", "ee", 0.0);
  made->description.gain("kp", 1.0).range(0, 10).in("1").about("x");
  ControllerEntry entry;
  entry.config_file = temporaryFile("own.yaml", "kp: 5\n");
  rig.add(std::move(made), "own", true, entry);
  EXPECT_EQ(rig.manager->getGains("own").all().at("kp"), std::vector<double>{5.0});
  ASSERT_TRUE(rig.manager->setGains("own", {{"kp", {7.0}}}));
  const Status status = rig.manager->loadGains("own", "");
  EXPECT_EQ(status.cause(), Cause::InvalidArgument);
  EXPECT_TRUE(contains(status.message(), "'own'")) << status.message();
  EXPECT_EQ(rig.manager->getGains("own").all().at("kp"), std::vector<double>{7.0});
  ASSERT_TRUE(rig.manager->reloadGains("own"));
  EXPECT_EQ(rig.manager->getGains("own").all().at("kp"), std::vector<double>{5.0});
  EXPECT_EQ(rig.manager->reloadGains("nobody").cause(), Cause::UnknownName);
}

}  // namespace
}  // namespace ctrl_more
