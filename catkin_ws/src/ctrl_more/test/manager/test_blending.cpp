#include <random>

#include "manager/guard.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

constexpr double kBlend = 0.1;             // [s]
constexpr double kShare = 0.005 / kBlend;  // of a change, per cycle

// A pose controller that shifts by 1 and turns by 0.4 rad, and a velocity one that adds 1.
struct Blending : ::testing::Test {
  Rig rig{kBlend};
  TestController *pose, *velocity;
  Blending() {
    auto p = adder("pose", "ee", 0.0);
    p->on_write = [](TestController& self, ModifiedControlStates& m) {
      auto v = m[self.out];
      v[0] += 1.0;
      const Eigen::Quaterniond before(v.tail<4>().data());
      v.tail<4>() = (expOf({0, 0, 0.4}) * before).coeffs();
    };
    pose = rig.add(std::move(p), "pose", false);
    velocity = rig.add(adder("vel", "ee", 1.0), "velocity", false);
  }
  double angle() const { return logOf(Eigen::Quaterniond(rig.pose().tail<4>().data())).norm(); }
  // Steps and checks that nothing moved by more than its share.
  void stepSmoothly(int cycles, double largest = 1.0) {
    for (int i = 0; i < cycles; ++i) {
      const double x = rig.pose()[0], a = angle(), v = rig.twist()[0];
      rig.step();
      EXPECT_LE(std::abs(rig.pose()[0] - x), largest * kShare + 1e-9);
      EXPECT_LE(std::abs(angle() - a), 0.4 * largest * kShare + 1e-9);
      EXPECT_LE(std::abs(rig.twist()[0] - v), largest * kShare + 1e-9);
    }
  }
};

TEST_F(Blending, EnableAndDisableAreBumpless) {
  rig.step();
  rig.manager->enable();
  stepSmoothly(20);
  EXPECT_EQ(rig.pose()[0], 1.0);
  EXPECT_NEAR(angle(), 0.4, 1e-12);
  EXPECT_EQ(rig.twist()[0], 1.0);
  rig.manager->disable();
  stepSmoothly(20);
  EXPECT_EQ(rig.pose()[0], 0.0);
  EXPECT_EQ(angle(), 0.0);
  EXPECT_EQ(rig.manager->status("pose").activity, Activity::Off);
}

TEST_F(Blending, PausedPoseHoldsItsDifferenceAndPausedVelocityFades) {
  rig.manager->enable();
  rig.step(30);
  rig.manager->pause();
  stepSmoothly(40);
  EXPECT_EQ(rig.pose()[0], 1.0) << "the difference is held";
  EXPECT_EQ(rig.twist()[0], 0.0) << "a held velocity would drift the arm for ever";
  rig.step(1, 7.0);
  EXPECT_EQ(rig.pose()[0], 8.0) << "the difference, not the absolute pose";
  const int updates = pose->updates;
  rig.step(1);
  EXPECT_EQ(pose->updates, updates);
  rig.manager->resume();
  stepSmoothly(30);
  EXPECT_EQ(rig.twist()[0], 1.0);
}

TEST_F(Blending, DisablingReleasesAHeldCorrection) {
  rig.manager->enable();
  rig.step(30);
  rig.manager->pause();
  rig.step(30);
  rig.manager->disable();
  stepSmoothly(20);
  EXPECT_EQ(rig.pose()[0], 0.0);
}

TEST_F(Blending, ReversingDuringABlendIsBumpless) {
  std::mt19937 random(7);
  rig.step();
  for (int i = 0; i < 300; ++i) {
    switch (random() % 5) {
      case 0:
        rig.manager->enable();
        break;
      case 1:
        rig.manager->disable();
        break;
      case 2:
        rig.manager->pause("pose");
        break;
      case 3:
        rig.manager->resume("pose");
        break;
      case 4:
        rig.manager->setExecutionOrder(random() % 2 == 0
                                           ? std::vector<std::string>{"pose", "velocity"}
                                           : std::vector<std::string>{"velocity", "pose"});
    }
    stepSmoothly(1 + static_cast<int>(random() % 9));
  }
}

TEST_F(Blending, PublishingUnrelatedPlansDoesNotProlongAFade) {
  rig.manager->enable();
  rig.step(30);
  rig.manager->disable("pose");
  for (int i = 0; i < 20; ++i) {
    rig.manager->setGains("velocity", {});
    rig.step();
  }
  EXPECT_EQ(rig.pose()[0], 0.0);
}

TEST(BlendingTest, OrderChangeOfACascadeIsBumpless) {
  Rig rig(kBlend);
  rig.add(adder("pose", "ee", 1.0), "add");
  auto doubling = adder("pose", "ee", 0.0);
  doubling->on_write = [](TestController& self, ModifiedControlStates& m) {
    m[self.out][0] *= 2.0;
  };
  rig.add(std::move(doubling), "double");
  rig.step(30);
  EXPECT_EQ(rig.pose()[0], 2.0);
  rig.manager->setExecutionOrder({"double", "add"});
  double last = 2.0;
  for (int i = 0; i < 20; ++i) {
    rig.step();
    EXPECT_LE(std::abs(rig.pose()[0] - last), 2.0 * kShare + 1e-12);
    last = rig.pose()[0];
  }
  EXPECT_EQ(rig.pose()[0], 1.0);
}

TEST(CorrectionTest, DifferenceAndApplyAreInverse) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const SignalKind kind : {SignalKind::Vector, SignalKind::Pose, SignalKind::Quaternion}) {
    const int size = kind == SignalKind::Quaternion ? 4 : 7;
    for (int i = 0; i < 2000; ++i) {
      Eigen::VectorXd a(size), b(size), c(size), d(size), identity(size);
      for (auto* v : {&a, &b}) {
        for (int k = 0; k < size; ++k) (*v)[k] = normal(random);
        if (kind != SignalKind::Vector) v->tail(4).normalize();
      }
      correction::difference(kind, size, a.data(), b.data(), c.data());
      correction::apply(kind, size, a.data(), c.data(), d.data());
      EXPECT_LT((d - b).cwiseAbs().maxCoeff(), 1e-14);
      correction::setIdentity(kind, size, identity.data());
      correction::apply(kind, size, a.data(), identity.data(), d.data());
      EXPECT_EQ(0, std::memcmp(a.data(), d.data(), size * sizeof(double))) << "bit for bit";
      correction::between(kind, size, identity.data(), c.data(), 1.0, d.data());
      // q and -q turn alike.
      if (kind != SignalKind::Vector && d.tail(4).dot(c.tail(4)) < 0) d.tail(4) *= -1;
      EXPECT_LT((d - c).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

}  // namespace
}  // namespace ctrl_more
