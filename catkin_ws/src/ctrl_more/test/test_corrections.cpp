// How corrections are computed: every number of a signal counts, and none beside it.
#include <cmath>

#include "manager/guard.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Kind = SignalKind;
constexpr double kBeside = 1234.5;  // stands behind the numbers of a signal

// Numbers with one more behind them.
std::vector<double> guarded(std::vector<double> numbers) {
  numbers.push_back(kBeside);
  return numbers;
}

std::vector<double> turned(const Eigen::Vector3d& rotation, double x = 0, double y = 0,
                           double z = 0) {
  const Eigen::Quaterniond q = expOf(rotation);
  return guarded({x, y, z, q.x(), q.y(), q.z(), q.w()});
}

TEST(Corrections, EveryNumberDecidesWhetherThereIsOne) {
  const std::vector<double> none = {0, 0, 0, 0, 0, 0, 1};
  EXPECT_TRUE(correction::isIdentity(Kind::Pose, 7, none.data()));
  EXPECT_TRUE(correction::isIdentity(Kind::Quaternion, 4, none.data() + 3));
  EXPECT_FALSE(correction::isIdentity(Kind::Vector, 7, none.data()));
  for (int i = 0; i < 7; ++i) {
    std::vector<double> some = none;
    some[i] += 1e-12;
    EXPECT_FALSE(correction::isIdentity(Kind::Pose, 7, some.data())) << i;
    std::vector<double> vector(7, 0.0);
    EXPECT_TRUE(correction::isIdentity(Kind::Vector, 7, vector.data()));
    vector[i] = -1e-12;
    EXPECT_FALSE(correction::isIdentity(Kind::Vector, 7, vector.data())) << i;
  }
}

TEST(Corrections, NothingBesideASignalIsTouched) {
  for (const Kind kind : {Kind::Vector, Kind::Pose}) {
    const std::vector<double> before = turned({0.1, 0, 0}, 1, 2, 3);
    const std::vector<double> after = turned({0.3, 0.1, 0}, 4, 3, 1);
    std::vector<double> c = turned({0, 0, 0}), out = c;
    correction::difference(kind, 7, before.data(), after.data(), c.data());
    EXPECT_EQ(c[7], kBeside);
    EXPECT_EQ(c[0], 3.0);
    EXPECT_EQ(c[2], -2.0);
    correction::apply(kind, 7, before.data(), c.data(), out.data());
    EXPECT_EQ(out[7], kBeside);
    EXPECT_EQ(out[2], 1.0);
    correction::between(kind, 7, before.data(), after.data(), 0.5, out.data());
    EXPECT_EQ(out[7], kBeside);
    EXPECT_EQ(out[0], 2.5);
    correction::setIdentity(kind, 7, out.data());
    EXPECT_EQ(out[7], kBeside);
  }
}

TEST(Corrections, OutMayBeTheInput) {
  const std::vector<double> before = turned({0.2, 0.1, -0.4}, 1, 2, 3);
  const std::vector<double> c = turned({-0.3, 0.5, 0.1}, 1, 1, 1);
  std::vector<double> apart = before, same = before;
  correction::apply(Kind::Pose, 7, before.data(), c.data(), apart.data());
  correction::apply(Kind::Pose, 7, same.data(), c.data(), same.data());
  EXPECT_EQ(apart, same);
  std::vector<double> middle = before, in_place = c;
  correction::between(Kind::Pose, 7, before.data(), c.data(), 0.25, middle.data());
  correction::between(Kind::Pose, 7, before.data(), in_place.data(), 0.25, in_place.data());
  EXPECT_EQ(middle, in_place);
}

TEST(Corrections, NormsAreThoseOfPositionAndTurnAboutAnyAxis) {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(0.4, 0, 0), Eigen::Vector3d(0, 0.4, 0), Eigen::Vector3d(0, 0, 0.4),
        Eigen::Vector3d(0.2, -0.3, 0.1), Eigen::Vector3d(M_PI, 0, 0), Eigen::Vector3d(0, 0, 0)}) {
    const std::vector<double> pose = turned(axis, 2, 3, 6);
    const correction::Norms norms = correction::norms(Kind::Pose, 7, pose.data());
    EXPECT_DOUBLE_EQ(norms.size, 7.0);
    EXPECT_NEAR(norms.angle, axis.norm(), 1e-12);
    const correction::Norms turn = correction::norms(Kind::Quaternion, 4, pose.data() + 3);
    EXPECT_EQ(turn.size, 0.0);
    EXPECT_NEAR(turn.angle, axis.norm(), 1e-12);
  }
  // Exactly half a turn: the quaternion's vector is exactly unit.
  const double half[4] = {0, 0, 1, 0};
  EXPECT_DOUBLE_EQ(correction::norms(Kind::Quaternion, 4, half).angle, M_PI);
  const std::vector<double> vector = guarded({2, 3, 6});
  EXPECT_DOUBLE_EQ(correction::norms(Kind::Vector, 3, vector.data()).size, 7.0);
  EXPECT_EQ(correction::norms(Kind::Vector, 3, vector.data()).angle, 0.0);
}

TEST(Corrections, OnlyTheNumbersOfTheSignalAreJudged) {
  const double numbers[3] = {1.0, 2.0, std::nan("")};
  EXPECT_TRUE(correction::isFinite(2, numbers));
  EXPECT_FALSE(correction::isFinite(3, numbers));
  for (const double off : {-1.0, 1.0}) {
    const double nearly[4] = {0, 0, 0, 1.0 + 0.9e-6 * off};
    const double beyond[4] = {0, 0, 0, 1.0 + 1.1e-6 * off};
    EXPECT_TRUE(correction::isUnit(Kind::Quaternion, 4, nearly)) << "unit within 1e-6";
    EXPECT_FALSE(correction::isUnit(Kind::Quaternion, 4, beyond)) << "unit within 1e-6";
  }
}

TEST(Rotations, LogAndExpAgreeWithTheirDefinitionHoweverSmallTheAngle) {
  for (const double angle : {1e-14, 1e-10, 5e-10, 2e-9, 1e-6, 0.3, 3.0}) {
    const Eigen::Vector3d vector = angle * Eigen::Vector3d(0.36, 0.48, -0.8);
    const Eigen::Quaterniond q = expOf(vector);
    EXPECT_NEAR(q.norm(), 1.0, 1e-15);
    EXPECT_LT((q.vec() - std::sin(angle / 2) / angle * vector).norm(), 1e-12 * angle) << angle;
    EXPECT_LT((logOf(q) - vector).norm(), 1e-9 * angle) << angle;
    const Eigen::Quaterniond same(-q.w(), -q.x(), -q.y(), -q.z());
    EXPECT_LT((logOf(same) - vector).norm(), 1e-9 * angle) << "q and -q turn alike";
  }
  EXPECT_EQ(expOf(Eigen::Vector3d::Zero()).coeffs(), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(logOf(Eigen::Quaterniond::Identity()), Eigen::Vector3d(0, 0, 0));
  EXPECT_LT((logOf(Eigen::Quaterniond(0, 0, 0, 1)) - Eigen::Vector3d(0, 0, M_PI)).norm(), 1e-15);
}

}  // namespace
}  // namespace ctrl_more
