#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(AttributionTest, AttributionContainsControllerSignalAndChange) {
  Rig rig;
  rig.add(adder("pose", "ee", 1.0), "a");
  rig.add(adder("pose", "ee", -0.25), "b");
  rig.add(adder("pose", "ee", 9.0), "off", false);
  auto turning = adder("pose", "ee", 0.0);
  turning->on_write = [](TestController& self, ModifiedControlStates& m) {
    m[self.out].tail<4>() = Eigen::Vector4d(0, std::sin(0.15), 0, std::cos(0.15));
  };
  rig.add(std::move(turning), "turn");
  rig.step(2, 5.0);
  const std::vector<Attribution> list = rig.manager->attribution();
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[0].controller, "a");
  EXPECT_EQ(list[0].signal, "taskSpaceReferencePose/ee");
  EXPECT_EQ(list[0].cycle, rig.cycle.number);
  EXPECT_EQ(list[0].before[0], 5.0);
  EXPECT_EQ(list[0].after[0], 6.0);
  EXPECT_EQ(list[0].size, 1.0);
  EXPECT_EQ(list[1].before, list[0].after) << "a chain without a gap";
  EXPECT_EQ(list[1].size, 0.25);
  EXPECT_EQ(list[2].controller, "turn");
  EXPECT_NEAR(list[2].angle, 0.3, 1e-12);
}

TEST(AttributionTest, RepeatedAttributionIsThatOfTheLastCycle) {
  Rig rig;
  double amount = 0.0;
  auto c = adder("pose", "ee", 0.0);
  c->on_write = [&](TestController& self, ModifiedControlStates& m) { m[self.out][0] += amount; };
  rig.add(std::move(c), "c");
  for (int i = 1; i <= 7; ++i) {
    amount = i;
    rig.step(i % 3 + 1);
    for (int asked = 0; asked < i % 4; ++asked) {
      const std::vector<Attribution> list = rig.manager->attribution();
      ASSERT_EQ(list.size(), 1u);
      EXPECT_EQ(list[0].cycle, rig.cycle.number);
      EXPECT_EQ(list[0].size, i);
    }
  }
  rig.manager->beginCycle({0, 0.005, 1000});  // a cycle is running: what is complete is given
  const std::vector<Attribution> meanwhile = rig.manager->attribution();
  ASSERT_EQ(meanwhile.size(), 1u);
  EXPECT_EQ(meanwhile[0].cycle, rig.cycle.number);
}

}  // namespace
}  // namespace ctrl_more
