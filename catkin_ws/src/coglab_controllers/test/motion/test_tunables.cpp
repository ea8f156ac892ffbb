// Gains that change while the arm moves.
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

TEST(Tunables, AreAllSetOrNone) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  Tunables& gains = *robot.ptp().tunables();
  const auto kp = [&] { return gains.all().front().wanted(); };
  const double before = kp();
  ASSERT_EQ(gains.all().front().name, "Kp");
  EXPECT_TRUE(gains.set({{"Kp", 8.0}}).success);
  EXPECT_EQ(kp(), 8.0);
  EXPECT_NE(before, 8.0);
  const Answer range = gains.set({{"Kp", 5.0}, {"default_speed", 1.5}});
  EXPECT_EQ(range.code, ReasonCode::OutOfRange);
  EXPECT_EQ(gains.set({{"Kp", std::nan("")}}).code, ReasonCode::InvalidArgument);
  EXPECT_EQ(gains.set({{"Kp", 5.0}, {"pos_clik_gain", 5.0}}).code, ReasonCode::InvalidArgument);
  EXPECT_EQ(kp(), 8.0);
}

TEST(Tunables, ChangesOfTheDefaultSpeedCountForTheNextMotion) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const auto fastest = [&](const std::vector<double>& to) {
    double most = 0.0;
    EXPECT_EQ(robot.ptp().add({to, {}, {}}).status, MotionAnswer::kStarted);
    do {
      robot.tick();
      most = std::max(most, robot.command.velocity.lpNorm<Eigen::Infinity>());
    } while (robot.state() == MotionState::Running);
    return most;
  };
  const double slow = fastest({-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6});
  ASSERT_TRUE(
      robot.ptp().tunables()->set({{"default_speed", 0.9}, {"default_acceleration", 0.9}}).success);
  EXPECT_GT(fastest({-1.4, -0.6, 1.5, 1.7, 0.2, 0.2, 0.8}), 1.3 * slow);
}

/// Each gain jumps between the ends of its range every 40 cycles, while the goal of a DMP motion
/// moves and the arm lags behind. No joint is commanded to accelerate beyond its limit.
void expectNoSteps(const std::string& parameters, const std::vector<std::string>& expected) {
  VirtualRobot probe(parameters);
  probe.loadBoth("dmp");
  std::vector<std::string> names;
  for (const Tunable& gain : probe.dmp().tunables()->all()) names.push_back(gain.name);
  for (const std::string& name : expected)
    ASSERT_EQ(std::count(names.begin(), names.end(), name), 1) << name;
  for (const std::string& name : names) {
    VirtualRobot robot(parameters);
    robot.followWithinLimits();
    robot.loadBoth("dmp");
    const auto goal = [](int cycle) { return Vector3(0.75, 0.1 * std::sin(0.01 * cycle), 0.45); };
    robot.see("human_hand", goal(0));
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    Tunables& gains = *robot.dmp().tunables();
    const auto gain = std::find_if(gains.all().begin(), gains.all().end(),
                                   [&](const Tunable& one) { return one.name == name; });
    JointVector before = JointVector::Zero();
    double worst = 0.0;
    for (int cycle = 0; cycle < 600; ++cycle) {
      if (cycle % 40 == 0) {
        ASSERT_TRUE(gains.set({{name, cycle % 80 == 0 ? gain->most : gain->least}}).success);
      }
      robot.see("human_hand", goal(cycle));
      robot.tick();
      const JointVector change = (robot.command.velocity - before) / robot.period;
      worst =
          std::max(worst, change.cwiseAbs().cwiseQuotient(robot.limits.acceleration).maxCoeff());
      before = robot.command.velocity;
    }
    EXPECT_LE(worst, 1.0) << name;
  }
}

TEST(Tunables, JumpsOfEveryGainMakeNoStepOfTheVelocity) {
  expectNoSteps("", {"pos_clik_gain", "rot_clik_gain", "correction_speed", "goal_max_speed"});
}

TEST(Tunables, JumpsOfTheGainOfAnotherSecondTaskMakeNoStep) {
  expectNoSteps("dmp: {second_task: axis, axis: [0, 0, 1]}", {"rot_clik_gain"});
}

}  // namespace
}  // namespace coglab_controllers
