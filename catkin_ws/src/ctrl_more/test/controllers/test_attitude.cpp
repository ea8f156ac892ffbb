#include <random>

#include "controller_rig.hpp"

namespace ctrl_more {
namespace {

// Body whose orientation follows its command with a first-order lag and a constant disturbance,
// about one fixed axis: tau th' = th_cmd + d - th.
struct Plant {
  double tau, disturbance, angle = 0.0, rate = 0.0;
  void step(double command, double dt) {
    rate = (command + disturbance - angle) / tau;
    angle += dt * rate;
  }
};

struct AttitudeTest : ::testing::Test {
  ControllerRig rig;
  void setImu(const Eigen::Quaterniond& q, const Eigen::Vector3d& rate) {
    const Eigen::Matrix3d r = q.toRotationMatrix();
    Eigen::VectorXd imu(9);
    imu << std::atan2(r(2, 1), r(2, 2)), std::asin(std::max(-1.0, std::min(1.0, -r(2, 0)))),
        std::atan2(r(1, 0), r(0, 0)), rate, 0, 0, 9.81;
    rig.robot.setMeasuredData("imu", imu, rig.cycle.now_ns);
  }
  Eigen::Vector3d correction() {
    return logOf(Eigen::Quaterniond(rig.control.getPelvisOrientation()));
  }
};

TEST_F(AttitudeTest, ProportionalAndDampingFollowTheClosedForm) {
  const double kp = 2.0, kd = 0.05, tau = 0.2, d = 0.1, dt = 1e-4;
  ASSERT_TRUE(rig.load("attitude", "kp: 2\nkd: 0.05\nmax_angle: 1\n"));
  Plant plant{tau, d};
  plant.rate = d / (tau + kd);
  double t = 0.0;
  for (int i = 0; i < 6000; ++i) {
    setImu(expOf({plant.angle, 0, 0}), {plant.rate, 0, 0});
    rig.setReferences();
    rig.cycleOnce(dt);
    // (tau + kd) th' = d - (1 + kp) th, with the rate of the same instant
    const double command = correction().x();
    plant.step(command, dt);
    t += dt;
    const double exact = d / (1 + kp) * (1 - std::exp(-t * (1 + kp) / (tau + kd)));
    ASSERT_NEAR(plant.angle, exact, 5e-5) << "t = " << t;
  }
  EXPECT_NEAR(plant.angle, d / (1 + kp), 1e-4);
}

TEST_F(AttitudeTest, OneStepDelayConvergesBelowOneAndDivergesAbove) {
  for (const double kp : {0.95, 1.05}) {
    ControllerRig fresh;
    ASSERT_TRUE(fresh.load("attitude", "kp: " + std::to_string(kp) + "\nkd: 0\nmax_angle: 1\n"));
    double angle = 0.01;
    for (int i = 0; i < 30; ++i) {
      Eigen::VectorXd imu(9);
      imu << angle, 0, 0, 0, 0, 0, 0, 0, 9.81;
      fresh.robot.setMeasuredData("imu", imu, fresh.cycle.now_ns);
      fresh.setReferences();
      fresh.cycleOnce();
      angle = logOf(Eigen::Quaterniond(fresh.control.getPelvisOrientation())).x();
    }
    EXPECT_EQ(std::abs(angle) < 0.01, kp < 1.0) << kp << " " << angle;
  }
}

TEST_F(AttitudeTest, TurningTheWorldTurnsTheResult) {
  ASSERT_TRUE(rig.load("attitude",
                       "kp: [0.5, 0.3, 0.1]\nkd: [0.02, 0.01, 0.03]\nki: [1, 2, 3]\n"
                       "max_angle: 1\nimu_layout: quaternion_gyro_acc\n"));
  ControllerRig turned;
  ASSERT_TRUE(turned.load("attitude",
                          "kp: [0.5, 0.3, 0.1]\nkd: [0.02, 0.01, 0.03]\nki: [1, 2, 3]\n"
                          "max_angle: 1\nimu_layout: quaternion_gyro_acc\n"));
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 0.2);
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  const Eigen::Quaterniond world = expOf({1.0, -2.0, 0.5});
  for (int i = 0; i < 200; ++i) {
    const Eigen::Quaterniond body = expOf(vector()), reference = expOf(vector());
    const Eigen::Vector3d rate = vector();
    for (ControllerRig* r : {static_cast<ControllerRig*>(&rig), &turned}) {
      const Eigen::Quaterniond w =
          r == &turned ? world : Eigen::Quaterniond(Eigen::Quaterniond::Identity());
      Eigen::VectorXd imu(10);
      imu << (w * body).coeffs(), rate, 0, 0, 9.81;
      r->robot.setMeasuredData("imu", imu, r->cycle.now_ns);
      r->control.setPelvisOrientation((w * reference).toRotationMatrix());
      r->cycleOnce();
    }
    EXPECT_LT((turned.control.getPelvisOrientation() -
               world.toRotationMatrix() * rig.control.getPelvisOrientation())
                  .norm(),
              1e-12);
  }
}

TEST_F(AttitudeTest, SaturatesWithoutWindingUpAndHasADeadBand) {
  ASSERT_TRUE(rig.load("attitude", "kp: 0\nkd: 0\nki: 10\nmax_angle: 0.1\ndead_band: 0.05\n"));
  for (int i = 0; i < 2000; ++i) {
    setImu(expOf({-0.5, 0, 0}), {0, 0, 0});
    rig.setReferences();
    rig.cycleOnce();
    ASSERT_LE(correction().norm(), 0.1 + 1e-12);
  }
  EXPECT_NEAR(correction().x(), 0.1, 0.03);
  // Ten seconds in saturation must not have to be paid back.
  int cycles = 0;
  for (; cycles < 200 && correction().x() > 0.0; ++cycles) {
    setImu(expOf({0.5, 0, 0}), {0, 0, 0});
    rig.setReferences();
    rig.cycleOnce();
  }
  EXPECT_LT(cycles, 10);
  ControllerRig quiet;
  ASSERT_TRUE(quiet.load("attitude", "kp: 1\nkd: 0\ndead_band: 0.05\n"));
  quiet.robot.setMeasuredData("imu", vectorOf({0.049, 0, 0, 0, 0, 0, 0, 0, 0}), 0);
  quiet.setReferences();
  quiet.cycleOnce();
  EXPECT_EQ(quiet.control.getPelvisOrientation(), Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

TEST_F(AttitudeTest, WrongConfigurationsAreRefused) {
  EXPECT_FALSE(rig.load("attitude", "kp: 6\n"));
  EXPECT_FALSE(rig.load("attitude", "mount: [0, 0, 0, 0.5]\n"));
  EXPECT_FALSE(rig.load("attitude", "imu_layout: rpy\n"));
  rig.robot.declare(RobotSource::Measured, "imu", 10);
  EXPECT_FALSE(rig.load("attitude", "imu_layout: rpy_gyro_acc\n")) << "9 expected, 10 there";
  ASSERT_TRUE(rig.load("attitude", "imu_layout: quaternion_gyro_acc\n"));
  rig.robot.setMeasuredData("imu", vectorOf({0, 0, 0, 2, 0, 0, 0, 0, 0, 0}), 0);
  rig.cycleOnce();
  EXPECT_TRUE(contains(rig.manager->status("c").fault_text, "not unit"));
}

TEST_F(AttitudeTest, EveryLayoutOfTheSameMeasurementGivesTheSame) {
  const Eigen::Quaterniond body = expOf({0.1, -0.2, 0.05});
  const Eigen::Vector3d rate(0.3, -0.5, 0.7), acc(0.1, 0.2, 9.7);
  const Eigen::Vector4d q = body.coeffs();
  setImu(body, rate);
  Eigen::VectorXd rpy;
  rig.robot.getMeasuredData("imu", rpy);
  const std::vector<std::pair<std::string, Eigen::VectorXd>> layouts = {
      {"rpy_gyro_acc", rpy},
      {"quaternion_gyro_acc",
       vectorOf({q[0], q[1], q[2], q[3], rate[0], rate[1], rate[2], acc[0], acc[1], acc[2]})},
      {"quaternion_acc_gyro",
       vectorOf({q[0], q[1], q[2], q[3], acc[0], acc[1], acc[2], rate[0], rate[1], rate[2]})},
      {"quaternion_wxyz_acc_gyro",
       vectorOf({q[3], q[0], q[1], q[2], acc[0], acc[1], acc[2], rate[0], rate[1], rate[2]})}};
  for (const auto& layout : layouts) {
    ControllerRig fresh;
    ASSERT_TRUE(fresh.load("attitude",
                           "kp: 0.5\nkd: 0.1\nmax_angle: 1\nimu_layout: " + layout.first + "\n"));
    fresh.robot.setMeasuredData("imu", layout.second, fresh.cycle.now_ns);
    fresh.setReferences();
    fresh.cycleOnce();
    const Eigen::Vector3d expected = -0.5 * logOf(body) - 0.1 * (body * rate);
    const Eigen::Vector3d got = logOf(Eigen::Quaterniond(fresh.control.getPelvisOrientation()));
    EXPECT_LT((got - expected).norm(), 1e-12) << layout.first;
  }
}

}  // namespace
}  // namespace ctrl_more
