#include "controller_rig.hpp"

namespace ctrl_more {
namespace {

struct AdmittanceTest : ::testing::Test {
  ControllerRig rig;
  void push(const Eigen::VectorXd& wrench, int cycles, double x = 0.0) {
    for (int i = 0; i < cycles; ++i) {
      rig.robot.setMeasuredData("wrench", wrench, rig.cycle.now_ns);
      rig.setReferences(x);
      rig.cycleOnce();
    }
  }
  static Eigen::VectorXd force(double fx, double fy = 0, double fz = 0) {
    return vectorOf({fx, fy, fz, 0, 0, 0});
  }
};

TEST_F(AdmittanceTest, CriticalStepFollowsTheClosedFormInPoseAndVelocity) {
  ASSERT_TRUE(rig.load("ee_admittance",
                       "mass: 2\ndamping: 40\nstiffness: 200\nforce_dead_band: 0\n"
                       "max_offset: 0.4\nmax_velocity: 2\n"));
  const double wn = 10, f = 10;
  for (int i = 1; i <= 400; ++i) {
    push(force(f), 1, 0.3);
    const double t = 0.005 * i;
    ASSERT_NEAR(rig.pose()[0], 0.3 + f / 200 * (1 - (1 + wn * t) * std::exp(-wn * t)), 1e-13);
    ASSERT_NEAR(rig.twist()[0], f / 2 * t * std::exp(-wn * t), 1e-12);
    ASSERT_EQ(rig.pose()[1], 0.2);
  }
  // Released: decays with the same envelope.
  const double start = rig.pose()[0] - 0.3, v = rig.twist()[0];
  for (int i = 1; i <= 100; ++i) {
    push(force(0), 1, 0.3);
    const double t = 0.005 * i;
    ASSERT_NEAR(rig.pose()[0] - 0.3, (start + (v + wn * start) * t) * std::exp(-wn * t), 1e-13);
  }
  EXPECT_EQ(rig.manager->status("c").faults, 0u);
}

TEST_F(AdmittanceTest, BelowTheDeadBandEveryBitStays) {
  ControllerRig blended(0.2);  // with the default blending, too
  ASSERT_TRUE(blended.load("ee_admittance", "axes: all\n"));
  for (int i = 0; i < 100; ++i) {
    blended.robot.setMeasuredData("wrench", vectorOf({1, -2, 1.5, 0.3, 0.2, 0}),
                                  blended.cycle.now_ns);
    Eigen::VectorXd pose(7), twist(6);
    const Eigen::Quaterniond q = expOf({0.01 * i, -0.3, 0.2});
    pose << -0.0, 0.1 * i, 1.0 / 3.0, q.coeffs();
    twist << -0.0, 0, 0.1, -0.0, 0.2, 1.0 / 7.0;
    blended.control.setTaskSpaceReferencePose("ee", pose);
    blended.control.setTaskSpaceReferenceVel("ee", twist);
    const std::vector<double> before(blended.control.data(),
                                     blended.control.data() + blended.control.dataSize());
    blended.cycleOnce();
    ASSERT_EQ(0,
              std::memcmp(before.data(), blended.control.data(), before.size() * sizeof(double)));
  }
  EXPECT_EQ(blended.manager->status("c").activity, Activity::Running);
}

TEST_F(AdmittanceTest, DeadBandHasNoStepAtItsEdge) {
  ASSERT_TRUE(rig.load("ee_admittance", "force_dead_band: 3\nstiffness: 100\n"));
  push(force(3.001), 4000);
  EXPECT_NEAR(rig.pose()[0], 0.001 / 100, 1e-9);
}

TEST_F(AdmittanceTest, WithoutStiffnessTheHandStaysWhereItIsLed) {
  ASSERT_TRUE(rig.load("ee_admittance", "stiffness: 0\n"));
  push(force(0, 15), 60);
  push(force(0), 400);
  const double led = rig.pose()[1];
  EXPECT_GT(led, 0.21);
  push(force(0), 400);
  EXPECT_NEAR(rig.pose()[1], led, 1e-9);
}

TEST_F(AdmittanceTest, OffsetAndVelocityAreBounded) {
  ASSERT_TRUE(rig.load("ee_admittance", "max_offset: 0.1\nmax_velocity: 0.2\n"));
  Eigen::VectorXd last = vectorOf({0, 0.2, 0.3});
  for (int i = 0; i < 600; ++i) {
    push(force(300, 400), 1);
    const Eigen::Vector3d moved = rig.pose().head(3) - last;
    EXPECT_LE(moved.norm(), 0.2 * 0.005 + 1e-6);
    EXPECT_LE(rig.twist().head(3).norm(), 0.2 + 1e-12);
    last = rig.pose().head(3);
  }
  EXPECT_NEAR((rig.pose().head(3) - Eigen::Vector3d(0, 0.2, 0.3)).norm(), 0.1, 1e-12);
  EXPECT_EQ(rig.manager->status("c").faults, 0u);
}

TEST_F(AdmittanceTest, UnderAStrongPushPositionAndVelocityAgree) {
  ASSERT_TRUE(rig.load("ee_admittance", "mass: 0.5\nmax_offset: 0.4\nmax_velocity: 0.25\n"));
  double last = 0.2;
  for (int i = 0; i < 200; ++i) {
    push(force(0, 203), 1);
    ASSERT_NEAR(rig.pose()[1] - last, 0.25 * 0.005, 1e-9) << "as far as the speed that is sent";
    ASSERT_NEAR(rig.twist()[1], 0.25, 1e-12);
    last = rig.pose()[1];
  }
}

TEST_F(AdmittanceTest, ToolFrameAndRotation) {
  ASSERT_TRUE(rig.load("ee_admittance",
                       "wrench_frame: tool\naxes: all\nforce_dead_band: 0\ntorque_dead_band: 0\n"
                       "stiffness: 100\nrotary_stiffness: 10\nmax_velocity: 2\n"));
  const Eigen::Quaterniond tool = expOf({0, 0, M_PI / 2});  // tool x is base y
  for (int i = 0; i < 4000; ++i) {
    rig.robot.setMeasuredData("wrench", vectorOf({5, 0, 0, 1, 0, 0}), rig.cycle.now_ns);
    Eigen::VectorXd pose(7);
    pose << 0, 0, 0, tool.coeffs();
    rig.control.setTaskSpaceReferencePose("ee", pose);
    rig.control.setTaskSpaceReferenceVel("ee", Eigen::VectorXd::Zero(6));
    rig.cycleOnce();
  }
  EXPECT_NEAR(rig.pose()[1], 0.05, 1e-9);
  const Eigen::Vector3d turned =
      logOf(Eigen::Quaterniond(rig.pose().tail<4>().data()) * tool.conjugate());
  EXPECT_LT((turned - Eigen::Vector3d(0, 0.1, 0)).norm(), 1e-9);
}

TEST_F(AdmittanceTest, WrenchOfTheToolTurnsWithTheYieldedRotation) {
  ASSERT_TRUE(rig.load("ee_admittance",
                       "wrench_frame: tool\naxes: all\nforce_dead_band: 0\ntorque_dead_band: 0\n"
                       "stiffness: 100\nrotary_stiffness: 4\nmax_velocity: 2\n"));
  for (int i = 0; i < 4000; ++i) {
    rig.robot.setMeasuredData("wrench", vectorOf({5, 0, 0, 0, 0, 1.6}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce();
  }
  // Turned by 0.4 rad about z, so is the sensor, and with it the force it feels along its x.
  EXPECT_NEAR(rig.pose()[0], 0.05 * std::cos(0.4), 1e-9);
  EXPECT_NEAR(rig.pose()[1] - 0.2, 0.05 * std::sin(0.4), 1e-9);
}

// The profile of a handover: compliant while approaching, off before contact is armed.
TEST(Handover, CompliantInTheApproachAndOffBeforeContactIsArmed) {
  setenv("CTRL_MORE_PATH", CTRL_MORE_PLUGIN_DIR, 1);
  Rig rig(0.2);
  const LoadReport report = rig.manager->load(CTRL_MORE_SOURCE_DIR "/config/feedback.yaml", true);
  unsetenv("CTRL_MORE_PATH");
  ASSERT_TRUE(report.ok()) << report.text();
  double x = 0.0, pushed = 0.0;
  Eigen::VectorXd last_pose = vectorOf({0, 0.2, 0.3});
  const auto run = [&](int cycles, double fy) {
    for (int i = 0; i < cycles; ++i) {
      x += 0.0005;  // 0.1 m/s
      rig.robot.setMeasuredData("wrench", vectorOf({0, fy, 0, 0, 0, 0}), rig.cycle.now_ns);
      rig.robot.setMeasuredData("joint_position", Eigen::VectorXd::Zero(7), rig.cycle.now_ns);
      rig.step(1, x);
      const double jump = (rig.pose().head(3) - last_pose).norm();
      EXPECT_LT(jump, 0.003) << "no step anywhere";
      last_pose = rig.pose().head(3);
      pushed = rig.pose()[1] - 0.2;
    }
  };
  rig.manager->applyProfile("dmp");
  run(50, 12.0);
  EXPECT_EQ(pushed, 0.0) << "rigid by default";
  rig.manager->applyProfile("dmp_compliant", false);
  run(200, 12.0);
  EXPECT_NEAR(pushed, (12.0 - 3.0) / 200.0, 2e-3) << "gives way while approaching";
  // Near the receiver: back to the rigid profile; contact is armed once the correction has gone.
  rig.manager->applyProfile("dmp", false);
  int cycles = 0;
  for (; rig.manager->status("ee_admittance").activity != Activity::Off; ++cycles) {
    ASSERT_LT(cycles, 100);
    run(1, 12.0);
  }
  EXPECT_LE(cycles, 42) << "0.2 s";
  run(1, 12.0);
  EXPECT_EQ(pushed, 0.0);
  EXPECT_EQ(rig.twist().norm(), 0.0);
  for (const ControllerStatus& status : rig.manager->statusAll()) EXPECT_EQ(status.faults, 0u);
}

TEST_F(AdmittanceTest, AtItsBoundNothingMovesOutward) {
  ASSERT_TRUE(rig.load("ee_admittance", "max_offset: 0.1\nstiffness: 0\n"));
  push(force(23), 600);
  EXPECT_NEAR(rig.pose()[0], 0.1, 1e-12);
  EXPECT_NEAR(rig.twist().norm(), 0.0, 1e-12);
  push(force(-23), 1);
  EXPECT_LT(rig.twist()[0], 0.0) << "back at once";
}

TEST_F(AdmittanceTest, TranslationAloneLeavesTheTurnAlone) {
  ASSERT_TRUE(rig.load("ee_admittance", ""));
  push(vectorOf({20, 10, -5, 8, 9, 10}), 50);
  EXPECT_GT(rig.pose()[0], 0.01);
  EXPECT_EQ(rig.pose().tail(4), vectorOf({0, 0, 0, 1}));
  EXPECT_EQ(rig.twist().tail(3), vectorOf({0, 0, 0}));
}

TEST_F(AdmittanceTest, TheTurnIsBoundedLikeTheOffset) {
  ASSERT_TRUE(rig.load("ee_admittance", "axes: all\nmax_angle: 0.2\nrotary_stiffness: 0\n"));
  push(vectorOf({0, 0, 0, 3, 0, 4}), 400);
  const Eigen::Vector3d turn = logOf(Eigen::Quaterniond(rig.pose().tail<4>().data()));
  EXPECT_LT((turn - 0.2 * Eigen::Vector3d(0.6, 0, 0.8)).norm(), 1e-12);
  EXPECT_NEAR(rig.twist().norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace ctrl_more
