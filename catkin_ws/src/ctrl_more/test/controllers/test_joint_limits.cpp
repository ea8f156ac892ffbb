#include <random>

#include "controller_rig.hpp"

namespace ctrl_more {
namespace {

const std::string kConfiguration =
    "influence: 0.3\nsafety: 0.05\nxi: 1.0\nlower: [-1, -1, -1, -1, -1, -1, -1]\n"
    "upper: [1, 1, 1, 1, 1, 1, 1]\n";

struct JointLimitsTest : ::testing::Test {
  ControllerRig rig;
  Eigen::VectorXd run(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
    rig.robot.setMeasuredData("joint_position", q, rig.cycle.now_ns);
    rig.control.setJointSpaceReference("Velocity", qd);
    rig.cycleOnce();
    return rig.joints();
  }
};

TEST_F(JointLimitsTest, ConstantPushFollowsTheClosedForm) {
  ASSERT_TRUE(rig.load("joint_limits", kConfiguration));
  const double dt = 0.005, rho_s = 0.05, rho_i = 0.3, xi = 1.0;
  Eigen::VectorXd q = Eigen::VectorXd::Constant(7, 0.71);
  for (int k = 1; k <= 3000; ++k) {
    q += dt * run(q, Eigen::VectorXd::Constant(7, 2.0));
    const double rho = rho_s + (0.29 - rho_s) * std::pow(1 - xi * dt / (rho_i - rho_s), k);
    ASSERT_NEAR(1.0 - q[3], rho, 1e-12);
    ASSERT_GE(1.0 - q[3], rho_s - 1e-12) << "never crossed";
  }
}

TEST_F(JointLimitsTest, FarAwayOrLeavingKeepsEveryBit) {
  ASSERT_TRUE(rig.load("joint_limits", kConfiguration));
  const Eigen::VectorXd fast = Eigen::VectorXd::LinSpaced(7, -3.0, 3.0);
  EXPECT_EQ(run(Eigen::VectorXd::Zero(7), fast), fast);
  const Eigen::VectorXd leaving = Eigen::VectorXd::Constant(7, -3.0);
  EXPECT_EQ(run(Eigen::VectorXd::Constant(7, 0.99), leaving), leaving);
  EXPECT_EQ(run(Eigen::VectorXd::Constant(7, -0.99), -leaving), Eigen::VectorXd(-leaving));
}

TEST_F(JointLimitsTest, NeverPushesBackAndNeverSpeedsUp) {
  ASSERT_TRUE(rig.load("joint_limits", kConfiguration));
  std::mt19937 random(2);
  std::uniform_real_distribution<double> position(-1.2, 1.2), speed(-4, 4);
  for (int i = 0; i < 20000; ++i) {
    Eigen::VectorXd q(7), qd(7);
    for (int j = 0; j < 7; ++j) {
      q[j] = position(random);
      qd[j] = speed(random);
    }
    const Eigen::VectorXd out = run(q, qd);
    for (int j = 0; j < 7; ++j) {
      ASSERT_GE(out[j] * qd[j], 0.0);
      ASSERT_LE(std::abs(out[j]), std::abs(qd[j]));
      if (q[j] > 0.95) {
        ASSERT_LE(out[j], 0.0);
      }
      if (q[j] < -0.95) {
        ASSERT_GE(out[j], 0.0);
      }
    }
  }
}

TEST_F(JointLimitsTest, WrongConfigurationsAreRefused) {
  EXPECT_FALSE(rig.load("joint_limits", "influence: 0.1\nsafety: 0.2\n"));
  EXPECT_FALSE(rig.load("joint_limits", "lower: [-1, -1]\n"));
  EXPECT_FALSE(
      rig.load("joint_limits", "lower: [1, 1, 1, 1, 1, 1, 1]\nupper: [0, 1, 1, 1, 1, 1, 1]\n"));
  EXPECT_FALSE(rig.load("joint_limits", "lower: [-1, -1]\nupper: [1, 1]\n")) << "7 joints here";
  const auto degrees = rig.load("joint_limits",
                                "lower: [-170, -120, -170, -120, -170, -120, -170]\n"
                                "upper: [170, 120, 170, 120, 170, 120, 170]\n");
  EXPECT_NE(degrees.message().find("degrees"), std::string::npos) << degrees.message();
  ASSERT_TRUE(rig.load("joint_limits", kConfiguration));
  EXPECT_FALSE(rig.manager->setGains("c", {{"safety", {0.4}}})) << "not below influence";
  EXPECT_TRUE(rig.manager->setGains("c", {{"safety", {0.4}}, {"influence", {0.5}}}));
  EXPECT_FALSE(rig.manager->pause("c")) << "a safety controller";
}

TEST(JointLimitsOfAnyRobot, HaveTheNumberOfJointsInItsFile) {
  Logger logger;
  RobotStates robot(&logger);
  ControlStates control(0, 0.005, &logger);
  FeedbackControllersManager manager(robot, control, {}, &logger);
  const std::string file = ::testing::TempDir() + "/ctrl_more_two_joints.yaml";
  std::ofstream(file) << "lower: [-1, -1]\nupper: [1, 1]\n";
  ControllerEntry entry;
  entry.library = std::string(CTRL_MORE_PLUGIN_DIR) + "/libctrl_more_joint_limits.so";
  entry.config_file = file;
  ASSERT_TRUE(manager.loadController("limits", entry));
  EXPECT_EQ(control.joints(), 2);
  EXPECT_EQ(robot.find(RobotSource::Measured, "joint_position").size(), 2);
}

}  // namespace
}  // namespace ctrl_more
