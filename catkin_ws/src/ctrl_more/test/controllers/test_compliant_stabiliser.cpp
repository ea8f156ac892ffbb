#include <random>

#include "controller_rig.hpp"
#include "pendulum.hpp"
#include "second_order.hpp"

namespace ctrl_more {
namespace {

TEST(SecondOrderTest, AllDampingsAgreeWithSmallSteps) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  for (int n = 0; n < 300; ++n) {
    const double m = 0.2 + 5 * u(random), d = n % 7 == 0 ? 0.0 : 100 * u(random);
    const double k = n % 5 == 0 ? 0.0 : 1000 * u(random), f = u(random) - 0.5;
    SecondOrder coarse, fine;
    coarse.prepare(m, d, k, 0.01);
    fine.prepare(m, d, k, 0.01 / 64);
    double x = 0.1, v = -0.2, y = 0.1, w = -0.2;
    for (int i = 0; i < 50; ++i) {
      coarse.step(f, x, v);
      for (int j = 0; j < 64; ++j) fine.step(f, y, w);
      ASSERT_NEAR(x, y, 1e-11);
      ASSERT_NEAR(v, w, 1e-10);
    }
  }
}

struct CompliantTest : ::testing::Test {
  ControllerRig rig;
};

struct ClosedLoop : ::testing::Test {
  std::unique_ptr<ControllerRig> rig;

  bool load(const std::string& configuration) {
    rig = std::make_unique<ControllerRig>();
    return rig->load("compliant_stabiliser", configuration).ok();
  }
  double run(Pendulum& plant, double push, int cycles) {
    for (int i = 0; i < cycles; ++i) {
      rig->robot.setEstimatedData("zmp", vectorOf({plant.zmp(push, 0.005), 0, 0}),
                                  rig->cycle.now_ns);
      rig->setReferences();
      rig->cycleOnce();
      plant.references.push_back(rig->control.getCoM().x());
    }
    return rig->control.getCoM().x();
  }
};

TEST_F(ClosedLoop, StiffnessIsTheOneThatWasSetForEveryMassAndLag) {
  for (const double mass : {20.0, 40.0, 100.0}) {
    for (const double lag : {0.0, 0.02, 0.04, 0.08}) {
      for (const int delay : {1, 3}) {
        SCOPED_TRACE(std::to_string(mass) + " kg, lag " + std::to_string(lag) + " s, delay " +
                     std::to_string(delay));
        ASSERT_TRUE(load("total_mass: " + std::to_string(mass) + "\nheight: 0.8\n"));
        Pendulum plant{mass, 0.8, lag, delay};
        EXPECT_NEAR(run(plant, 20.0, 1000), 20.0 / 1000.0, 2e-4);
        EXPECT_NEAR(run(plant, 0.0, 1000), 0.0, 2e-4) << "it comes back";
        EXPECT_NEAR(run(plant, -30.0, 1000), -30.0 / 1000.0, 2e-4);
        EXPECT_EQ(rig->manager->status("c").faults, 0u);
      }
    }
  }
}

TEST_F(ClosedLoop, ComesBackFromTheWall) {
  ASSERT_TRUE(load("total_mass: 100\n"));
  Pendulum plant{100.0, 0.8, 0.02, 1};
  EXPECT_EQ(run(plant, 200.0, 800), 0.08) << "max_offset";
  EXPECT_NEAR(run(plant, 0.0, 1000), 0.0, 1e-5);
}

TEST_F(ClosedLoop, FollowsTheLawOfItsPage) {
  ASSERT_TRUE(
      load("mass: 20\ndamping: 400\nstiffness: 2000\nmax_offset: 0.3\ntotal_mass: 40\n"
           "height: 0.8\nforce_filter: 0.1\n"));
  Pendulum plant;
  // M x'' + D x' + K x = f, tau f' + f = push - m x'', in small steps.
  double x = 0.0, v = 0.0, f = 0.0;
  for (int i = 1; i <= 400; ++i) {
    for (int k = 0; k < 500; ++k) {
      const double h = 1e-5, a = (f - 400.0 * v - 2000.0 * x) / 20.0;
      f += h / 0.1 * (40.0 - 40.0 * a - f);
      v += h * a;
      x += h * v;
    }
    ASSERT_NEAR(run(plant, 40.0, 1), x, 8e-4) << i;
  }
  EXPECT_NEAR(x, 0.02, 1e-4);
}

TEST_F(CompliantTest, WithoutRoomToYieldNoVelocityIsSent) {
  ASSERT_TRUE(rig.load("compliant_stabiliser", "force_source: force\nmax_offset: 0\n"));
  for (int i = 0; i < 100; ++i) {
    rig.robot.setMeasuredData("contactForce", vectorOf({50, -50, 300}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce();
    ASSERT_EQ(rig.control.getCoM(), Eigen::Vector3d(0, 0, 0));
    ASSERT_EQ(rig.control.getCoMVelocity(), Eigen::Vector3d(0, 0, 0));
  }
}

TEST_F(CompliantTest, PoseAndVelocityFollowTheClosedForm) {
  ASSERT_TRUE(rig.load("compliant_stabiliser",
                       "force_source: force\nmass: [2, 20]\ndamping: [40, 300]\n"
                       "stiffness: [200, 1000]\nmax_offset: 0.3\n"));
  const double wn = 10, f = -10;
  for (int i = 1; i <= 100; ++i) {
    rig.robot.setMeasuredData("contactForce", vectorOf({f, 0, 300}), rig.cycle.now_ns);
    rig.setReferences();
    rig.cycleOnce();
    const double t = 0.005 * i;
    ASSERT_NEAR(rig.control.getCoM().x(), f / 200 * (1 - (1 + wn * t) * std::exp(-wn * t)), 1e-13);
    ASSERT_NEAR(rig.control.getCoMVelocity().x(), f / 2 * t * std::exp(-wn * t), 1e-12);
    ASSERT_EQ(rig.control.getCoM().tail<2>().norm(), 0.0);
    ASSERT_EQ(rig.control.getCoMVelocity().tail<2>().norm(), 0.0);
    const std::vector<double> shown = rig.manager->lastCycle().states.at(0).values;
    ASSERT_EQ(shown, (std::vector<double>{rig.control.getCoM().x(), 0.0, f, 0.0}));
  }
}

}  // namespace
}  // namespace ctrl_more
