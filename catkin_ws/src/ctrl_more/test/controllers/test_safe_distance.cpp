// Speed and separation by the distance to a person.
#include <cmath>

#include "ctrl_more/central_module.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

struct SafeDistanceTest : ::testing::Test {
  Logger logger;
  RobotStates robot{&logger};
  ControlStates control{7, 0.005, &logger};
  std::int64_t now = 1'000'000'000;
  std::uint64_t number = 0;

  SafeDistanceTest() {
    robot.declare(RobotSource::Estimated, "ee", 7, "m, 1", "base");
    robot.declare(RobotSource::Estimated, "person", 3, "m", "base");
    control.declare(ControlContainer::OtherReference, "speed_limit", 1, "m/s");
    setenv("CTRL_MORE_PATH", CTRL_MORE_PLUGIN_DIR, 1);
  }
  ~SafeDistanceTest() override { unsetenv("CTRL_MORE_PATH"); }

  CentralModule make(const std::string& settings) {
    return CentralModule(ConfigNode::fromText("managers: [f, safe]\nf: {type: Feedback}\n"
                                              "safe: {type: SafeDistance" +
                                                  settings + "}\n",
                                              "central.yaml"),
                         "", {robot, control, {}, {}}, &logger);
  }

  /// The limit with a person at this distance from the hand, m.
  double limitAt(CentralModule& module, double distance, double own = 1000.0) {
    now += 5'000'000;
    robot.setEstimatedData("ee", vectorOf({1, 2, 3, 0, 0, 0, 1}), now);
    robot.setEstimatedData("person", vectorOf({1, 2 + distance, 3}), now);
    return limit(module, own);
  }
  double limit(CentralModule& module, double own = 1000.0) {
    auto speed = control.view(control.find(ControlContainer::OtherReference, "speed_limit"));
    speed[0] = own;
    module.update({now, 0.005, ++number});
    return speed[0];
  }
};

TEST_F(SafeDistanceTest, AllowsTheSpeedWhoseSeparationDistanceIsTheDistance) {
  CentralModule module = make(
      ", person_speed: 1.6, reaction_time: 0.1, deceleration: 2, intrusion: 0.1, "
      "person_uncertainty: 0.04, robot_uncertainty: 0.01");
  for (const double distance : {0.4, 0.7, 1.5}) {
    const double v = limitAt(module, distance);
    ASSERT_GT(v, 0.0);
    const double stop_time = v / 2.0;
    const double person = 1.6 * (0.1 + stop_time), reaction = 0.1 * v, braking = v * v / 4.0;
    EXPECT_NEAR(person + reaction + braking + 0.15, distance, 1e-12);
  }
  EXPECT_EQ(limitAt(module, 0.31), 0.0) << "1.6 * 0.1 + 0.15 m are needed at standstill";
  EXPECT_EQ(limitAt(module, 1.5, 0.05), 0.05) << "a lower limit of another one stays";
}

TEST_F(SafeDistanceTest, StandsWithoutANewPosition) {
  CentralModule module = make(", max_age: 0.1");
  EXPECT_EQ(limit(module), 0.0) << "never seen";
  EXPECT_GT(limitAt(module, 2.0), 0.5);
  now += 101'000'000;
  EXPECT_EQ(limit(module), 0.0) << "too old";
  CentralModule slow = make(", max_age: 0.1, absent_speed: 0.25");
  EXPECT_EQ(limit(slow), 0.25);
}

struct ArmDistanceTest : SafeDistanceTest {
  ArmDistanceTest() {
    robot.declare(RobotSource::Estimated, "arm_points", 9, "m", "base");
    robot.declare(RobotSource::Estimated, "hand", 7, "m, 1", "base");
    robot.declare(RobotSource::Estimated, "head", 3, "m", "base");
  }
  /// Elbow, wrist and palm on a line along x, at 0, 0.4 and 0.6 m.
  double limitWith(CentralModule& module, const Eigen::Vector3d& hand,
                   const Eigen::Vector3d& head) {
    now += 5'000'000;
    robot.setEstimatedData("arm_points", vectorOf({0, 0, 0, 0.4, 0, 0, 0.6, 0, 0}), now);
    robot.setEstimatedData("hand", vectorOf({hand.x(), hand.y(), hand.z(), 0, 0, 0, 1}), now);
    robot.setEstimatedData("head", vectorOf({head.x(), head.y(), head.z()}), now);
    return limit(module);
  }
};

TEST_F(ArmDistanceTest, TheNearestPointOfThePersonAndOfTheWholeArmCount) {
  CentralModule module = make(", person: [hand, head], robot_radius: 0.1");
  CentralModule single = make(", robot: ee");  // one point, without a radius
  const Eigen::Vector3d away(0.0, 5.0, 0.0);
  const double allowed = limitWith(module, {0.2, 1.0, 0.0}, away);  // beside the forearm
  EXPECT_NEAR(allowed, limitAt(single, 0.9), 1e-12);
  EXPECT_NEAR(limitWith(module, away, {0.2, 0.0, 1.0}), allowed, 1e-12);
  EXPECT_EQ(limitWith(module, away, {-0.2, 0.0, 0.0}), 0.0) << "behind the elbow";
  EXPECT_EQ(limitWith(module, {0.65, 0.0, 0.0}, away), 0.0) << "nobody may touch";
  now += 1'000'000'000;
  robot.setEstimatedData("head", vectorOf({0.2, 1.0, 0.0}), now);
  EXPECT_NEAR(limit(module), allowed, 1e-12) << "the hand is out of sight, the head is seen";
}

TEST_F(ArmDistanceTest, ATouchingHandIsAllowedOnlyAtThePalmOfASlowArm) {
  CentralModule module =
      make(", person: [hand, head], touch: [hand], touch_speed: 0.25, robot_radius: 0.1");
  const Eigen::Vector3d away(0.0, 5.0, 0.0), palm(0.65, 0.0, 0.0);
  EXPECT_EQ(limitWith(module, palm, away), 0.25);
  EXPECT_GT(limitWith(module, {1.9, 0.0, 0.0}, away), 0.25);
  EXPECT_EQ(limitWith(module, {0.1, 0.1, 0.0}, away), 0.0) << "the hand at the forearm";
  EXPECT_EQ(limitWith(module, palm, {0.7, 0.1, 0.0}), 0.0) << "the head";
}

TEST_F(SafeDistanceTest, WrongBlocksAreRefused) {
  const auto refusal = [&](const std::string& settings) -> std::string {
    try {
      make(settings);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_TRUE(contains(refusal(", deceleration: 0"), "deceleration expects"));
  EXPECT_TRUE(contains(refusal(", person: nobody"), "needs a robot signal 'nobody'"));
  EXPECT_TRUE(contains(refusal(", persn: person"), "did you mean 'person'"));
  EXPECT_TRUE(contains(refusal(", person: []"), "person expects a key"));
  EXPECT_TRUE(contains(refusal(", touch: [hand]"), "touch has 'hand'"));
  EXPECT_TRUE(contains(refusal(", robot: nowhere"), "no points"));
}

}  // namespace
}  // namespace ctrl_more
