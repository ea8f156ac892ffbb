// What the shipped controllers tell the logger: that a bound of theirs holds, which one, with the
// numbers.
#include "controller_rig.hpp"

namespace ctrl_more {
namespace {

struct ControllerLogs : ::testing::Test {
  ControllerRig rig;
  std::shared_ptr<ListSink> sink = std::make_shared<ListSink>();

  void SetUp() override { rig.logger.addSink(sink); }

  // Runs two seconds of cycles; each begins with `measure`.
  void run(const std::function<void()>& measure) {
    for (int i = 0; i < 400; ++i) {
      measure();
      rig.cycleOnce();
    }
    rig.logger.drain();
  }

  // Once a second, from the controller's own name and source file.
  void expectSaid(const std::string& begin, const std::string& words) {
    int said = 0;
    for (const std::string& line : sink->lines) {
      if (line.rfind(begin, 0) != 0) continue;  // the manager's own
      ++said;
      EXPECT_TRUE(contains(line, ", cycle ")) << line;
      EXPECT_TRUE(contains(line, words)) << line;
    }
    EXPECT_EQ(said, 2) << "two seconds, one record in each";
  }
};

TEST_F(ControllerLogs, JointLimitsNamesTheJoint) {
  ASSERT_TRUE(rig.load("joint_limits", "influence: 0.2\n", "limits"));
  run([this] {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(7);
    q[3] = 2.0;
    rig.robot.setMeasuredData("joint_position", q, rig.cycle.now_ns);
    rig.control.setJointSpaceReference("Velocity", Eigen::VectorXd::Constant(7, 1.0));
  });
  expectSaid("[INFO] limits (joint_limits.cpp:", "joint 3 is slowed, at 2 rad");
}

TEST_F(ControllerLogs, EeAdmittanceNamesTheForce) {
  ASSERT_TRUE(rig.load("ee_admittance",
                       "max_offset: 0.01\nforce_dead_band: 0\nstiffness: 0\ndamping: 0\n"
                       "max_velocity: 2\n",
                       "yielding"));
  run([this] {
    rig.robot.setMeasuredData("wrench", vectorOf({0, 300, 0, 0, 0, 0}), rig.cycle.now_ns);
    rig.setReferences();
  });
  expectSaid("[WARN] yielding (ee_admittance.cpp:",
             "a force of 300 N holds it at max_offset, 0.01");
}

TEST_F(ControllerLogs, AttitudeNamesTheAngle) {
  ASSERT_TRUE(
      rig.load("attitude", "kp: 1\nkd: 0\nki: 0\ndead_band: 0\nmax_angle: 0.1\n", "upright"));
  run([this] {
    rig.robot.setMeasuredData("imu", vectorOf({0.5, 0, 0, 0, 0, 0, 0, 0, 9.81}), rig.cycle.now_ns);
    rig.setReferences();
  });
  expectSaid("[WARN] upright (attitude.cpp:", "correction of 0.5 rad is held at max_angle, 0.1");
}

TEST_F(ControllerLogs, CompliantStabiliserNamesTheAxis) {
  ASSERT_TRUE(rig.load(
      "compliant_stabiliser",
      "force_source: force\nmax_offset: 0.001\nmass: 1\ndamping: 0\nstiffness: 0\n", "soft"));
  run([this] {
    rig.robot.setMeasuredData("contactForce", vectorOf({0, 40, 300}), rig.cycle.now_ns);
    rig.setReferences();
  });
  expectSaid("[WARN] soft (compliant_stabiliser.cpp:", "holds axis 1 at max_offset, 0.001");
}

TEST_F(ControllerLogs, ZmpDcmNamesWhatIsWanted) {
  ASSERT_TRUE(rig.load("zmp_dcm", "mode: dcm\nk: 0\nsupport_box: 0.05\n", "balance"));
  run([this] {
    rig.robot.setEstimatedData("com", vectorOf({1, 0, 0, 0, 0, 0}), rig.cycle.now_ns);
    rig.setReferences();
  });
  expectSaid("[WARN] balance (zmp_dcm.cpp:",
             "ZMP is at the edge of the support box: 1 0 m are wanted");
}

TEST_F(ControllerLogs, ZmpInnerLoopNamesTheAxis) {
  ASSERT_TRUE(
      rig.load("zmp_dcm", "mode: zmp_ip\nki: 3.5\nmax_offset: 0.001\nzmp_filter: 0\n", "balance"));
  run([this] {
    rig.robot.setEstimatedData("zmp", vectorOf({0, 1, 0}), rig.cycle.now_ns);
    rig.setReferences();
  });
  expectSaid("[WARN] balance (zmp_dcm.cpp:", "offset of axis 1 is held at max_offset, 0.001");
}

// A bound of zero that nothing pushes against holds nothing.
TEST_F(ControllerLogs, NothingIsSaidWhereNoForceIs) {
  ASSERT_TRUE(rig.load("compliant_stabiliser", "force_source: force\nmax_offset: 0\n", "soft"));
  ASSERT_TRUE(rig.load("ee_admittance", "max_offset: 0\nmax_angle: 0\naxes: all\n", "hand"));
  run([this] {
    rig.robot.setMeasuredData("contactForce", vectorOf({0, 0, 300}), rig.cycle.now_ns);
    rig.robot.setMeasuredData("wrench", Eigen::VectorXd::Zero(6), rig.cycle.now_ns);
    rig.setReferences();
  });
  EXPECT_FALSE(sink->contains("max_offset"));
  EXPECT_EQ(rig.control.getCoM(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(rig.pose().head(3), vectorOf({0, 0.2, 0.3}));
}

}  // namespace
}  // namespace ctrl_more
