#include "controller_rig.hpp"
#include "pendulum.hpp"

namespace ctrl_more {
namespace {

constexpr double kDt = 0.005;

// Linear inverted pendulum with the ZMP held over a cycle, in its divergent component:
// xi_{k+1} = p + (xi_k - p) exp(w T).
double dcmAfter(double k, double height, double e0, int cycles, ControllerRig& rig) {
  const double w = std::sqrt(9.80665 / height);
  EXPECT_TRUE(rig.load("zmp_dcm", "mode: dcm\nk: " + std::to_string(k) + "\nheight: " +
                                      std::to_string(height) + "\nsupport_box: 1\n"));
  double xi = e0;
  for (int i = 0; i < cycles; ++i) {
    // Position zero: all of the divergent component is in the velocity.
    rig.robot.setEstimatedData("com", vectorOf({0, 0, 0, xi * w, 0, 0}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce(kDt);
    const double p = rig.control.getZMP().x();
    xi = p + (xi - p) * std::exp(w * kDt);
  }
  return xi;
}

TEST(ZmpDcmTest, ErrorDecaysByTheClosedForm) {
  ControllerRig rig;
  const double k = 20, height = 0.8, w = std::sqrt(9.80665 / height);
  const int n = 100;
  const double expected = 0.01 * std::pow(1 - (std::exp(w * kDt) - 1) * k / w, n);
  EXPECT_NEAR(dcmAfter(k, height, 0.01, n, rig), expected, 1e-13);
}

TEST(ZmpDcmTest, StableExactlyBelowTheBound) {
  const double height = 0.8, w = std::sqrt(9.80665 / height);
  const double bound = 2 * w / (std::exp(w * kDt) - 1);
  EXPECT_NEAR(bound, 396.0, 1.0);
  ControllerRig below, above;
  EXPECT_LT(std::abs(dcmAfter(0.99 * bound, height, 1e-6, 200, below)), 1e-6);
  EXPECT_GT(std::abs(dcmAfter(1.01 * bound, height, 1e-6, 200, above)), 1e-6);
}

TEST(ZmpDcmTest, StaysInTheSupportBox) {
  ControllerRig rig;
  ASSERT_TRUE(rig.load("zmp_dcm", "k: 10\nsupport_box: [0.05, 0.12, 0.03, 0.04]\n"));
  for (const double side : {1.0, -1.0}) {
    rig.robot.setEstimatedData("com", vectorOf({side, side, 0, 0, 0, 0}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce();
    EXPECT_EQ(rig.control.getZMP().x(), side > 0 ? 0.12 : -0.05);
    EXPECT_EQ(rig.control.getZMP().y(), side > 0 ? 0.04 : -0.03);
  }
}

TEST(ZmpDcmTest, ZmpIpFollowsItsClosedForm) {
  ControllerRig rig;
  const double kc = 6.0, ki = 3.5, disturbance = 0.01;
  ASSERT_TRUE(
      rig.load("zmp_dcm", "mode: zmp_ip\nkc: 6\nki: 3.5\nmax_offset: 0.3\nzmp_filter: 0\n"));
  double com = 0.0;
  for (int i = 1; i <= 600; ++i) {
    // Quasi-static: the ZMP stands under the centre of mass, plus a constant disturbance.
    rig.robot.setEstimatedData("zmp", vectorOf({com + disturbance, 0, 0}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce(kDt);
    com = rig.control.getCoM().x();
    const double exact = -disturbance / (1 + kc) * (1 - std::pow(1 - ki * kDt * (1 + kc), i));
    ASSERT_NEAR(com, exact, 1e-14);
  }
  EXPECT_NEAR(com, -disturbance / 7, 1e-9);
  EXPECT_NEAR(rig.control.getZMP().x(), -kc * com, 1e-9);
}

TEST(ZmpDcmTest, ZmpIpSettlesOnAPendulumThatFollowsLate) {
  for (const double mass : {20.0, 100.0}) {
    for (const double lag : {0.0, 0.02, 0.1}) {
      for (const int delay : {1, 3}) {
        ControllerRig rig;
        ASSERT_TRUE(rig.load("zmp_dcm", "mode: zmp_ip\n"));
        Pendulum plant{mass, 0.8, lag, delay};
        const double push = 0.01 * mass * 9.80665 / 0.8;  // moves the ZMP by 10 mm
        for (int i = 0; i < 3000; ++i) {
          const double zmp = plant.zmp(i < 2000 ? push : 0.0, kDt);
          rig.robot.setEstimatedData("zmp", vectorOf({zmp, 0, 0}), rig.cycle.now_ns);
          rig.setReferences();
          rig.cycleOnce(kDt);
          plant.references.push_back(rig.control.getCoM().x());
          ASSERT_LT(std::abs(rig.control.getCoM().x()), 0.03);
          if (i == 1999) EXPECT_NEAR(rig.control.getCoM().x(), -0.01 / 2, 1e-4) << lag << delay;
        }
        EXPECT_NEAR(rig.control.getCoM().x(), 0.0, 1e-4);
      }
    }
  }
}

}  // namespace
}  // namespace ctrl_more
