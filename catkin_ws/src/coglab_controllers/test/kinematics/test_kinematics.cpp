// Fixed-size kinematics against KDL, for the robot and for random arms of 6 and 7 joints.
#include <gtest/gtest.h>

#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

void expectEqualToKdl(const Chain& chain, Random& random, int rounds) {
  KDL::ChainFkSolverPos_recursive fk(chain.kdl());
  KDL::ChainJntToJacSolver jacobian_solver(chain.kdl());
  const unsigned n = static_cast<unsigned>(chain.joints());
  KDL::JntArray joints(n);
  KDL::Jacobian jacobian(n);
  KDL::Frame frame;
  double worst = 0.0;
  for (int k = 0; k < rounds; ++k) {
    const JointVector q = random.joints(3.0);
    joints.data = q.head(n);
    fk.JntToCart(joints, frame);
    jacobian_solver.JntToJac(joints, jacobian);
    const ChainState state = chain.evaluate(q);
    worst = std::max(worst, (jacobian.data - state.jacobian.leftCols(n)).cwiseAbs().maxCoeff());
    const Matrix3 rotation = state.tool.orientation.toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      worst = std::max(worst, std::abs(frame.p(row) - state.tool.position[row]));
      for (int column = 0; column < 3; ++column) {
        worst = std::max(worst, std::abs(frame.M(row, column) - rotation(row, column)));
      }
    }
    for (int i = chain.joints(); i < kMaxJoints; ++i)
      EXPECT_TRUE(state.jacobian.col(i).isZero(0.0));
  }
  EXPECT_LT(worst, 1e-12);
}

std::string randomArm(Random& random, int joints) {
  std::string text = "<robot name=\"arm\"><link name=\"l0\"/>";
  const auto triple = [&](double size) {
    const Vector3 v = random.point(size);
    return std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z());
  };
  int link = 0;
  const auto add = [&](const std::string& type) {
    const std::string parent = "l" + std::to_string(link), child = "l" + std::to_string(++link);
    text += "<link name=\"" + child + "\"/><joint name=\"j" + std::to_string(link) + "\" type=\"" +
            type + "\"><parent link=\"" + parent + "\"/><child link=\"" + child +
            "\"/><origin xyz=\"" + triple(0.4) + "\" rpy=\"" + triple(3.0) + "\"/><axis xyz=\"" +
            triple(1.0) + "\"/>" +
            "<limit lower=\"-3\" upper=\"3\" velocity=\"1\" effort=\"1\"/></joint>";
  };
  for (int i = 0; i < joints; ++i) {
    if (random.uniform(0, 1) < 0.3) add("fixed");
    add(random.uniform(0, 1) < 0.2 ? "continuous" : "revolute");
  }
  add("fixed");
  return text + "</robot>";
}

}  // namespace

TEST(Chain, EqualsKdlOnTheRobot) {
  Random random(1);
  EXPECT_EQ(robot().joints(), 7);
  EXPECT_EQ(robot().jointNames().front(), "lwr_a1");
  EXPECT_EQ(robot().jointNames()[2], "lwr_e1");
  EXPECT_NEAR(robot().reach(), 0.79, 1e-12);
  expectEqualToKdl(robot(), random, 100000);
}

TEST(Chain, EqualsKdlOnRandomArms) {
  Random random(2);
  for (int k = 0; k < 100; ++k) {
    const std::string urdf = randomArm(random, k % 2 ? 6 : 7);
    const auto count = [&](const std::string& word) {
      int found = 0;
      for (auto at = urdf.find(word); at != std::string::npos; at = urdf.find(word, at + 1))
        ++found;
      return found;
    };
    const Chain chain(urdf, "l0", "l" + std::to_string(count("<joint ")));
    EXPECT_EQ(chain.joints(), k % 2 ? 6 : 7);
    expectEqualToKdl(chain, random, 100);
  }
}

TEST(Chain, JacobianIsTheDerivative) {
  Random random(3);
  for (int k = 0; k < 2000; ++k) {
    const JointVector q = random.posture(0.0), velocity = random.joints(1.0);
    const double h = 1e-6;
    const ChainState a = robot().evaluate(q - h * velocity), b = robot().evaluate(q + h * velocity);
    const ChainState now = robot().evaluate(q);
    const Eigen::Matrix<double, 6, 1> twist = now.jacobian * velocity;
    EXPECT_LT(((b.tool.position - a.tool.position) / (2 * h) - twist.head<3>()).norm(), 1e-7);
    EXPECT_LT((rotationBetween(a.tool.orientation, b.tool.orientation) / (2 * h) - twist.tail<3>())
                  .norm(),
              1e-7);
    for (const int joint : {robot().elbowJoint(), robot().wristJoint()}) {
      const Vector3 difference = (b.origins.col(joint) - a.origins.col(joint)) / (2 * h);
      EXPECT_LT((difference - Chain::originVelocity(now, joint, velocity)).norm(), 1e-7);
    }
  }
}

TEST(Chain, TheJacobianOfTheMiddleLeadsToTheEndOfTheCycle) {
  Random random(7);
  const double dt = 0.005;
  for (int k = 0; k < 2000; ++k) {
    const JointVector q = random.posture(0.0), velocity = random.joints(1.9);
    ChainState now = robot().evaluate(q), middle;
    robot().evaluate(q, velocity, dt, middle);
    EXPECT_EQ(middle.tool.position, now.tool.position);
    const Vector3 way = robot().evaluate(q + dt * velocity).tool.position - now.tool.position;
    EXPECT_LT((way - dt * middle.jacobian.topRows<3>() * velocity).norm(), 1e-6);
  }
}

TEST(Chain, ReportsErrorsOfAUrdf) {
  const std::string urdf = robotUrdf();
  EXPECT_THROW(Chain("not xml", "a", "b"), std::invalid_argument);
  EXPECT_THROW(Chain(urdf, "lwr_base_link", "nowhere"), std::invalid_argument);
  EXPECT_THROW(Chain(urdf, "lwr_base_link", "lwr_link_3"), std::invalid_argument);
  Random random(4);
  std::string sliding = randomArm(random, 7);
  const auto at = sliding.find("\"revolute\"");
  ASSERT_NE(at, std::string::npos);
  sliding.replace(at, 10, "\"prismatic\"");
  std::string tip = "l1";
  for (int i = 1; sliding.find("\"l" + std::to_string(i) + "\"") != std::string::npos; ++i)
    tip = "l" + std::to_string(i);
  try {
    Chain(sliding, "l0", tip);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("revolute"), std::string::npos) << error.what();
  }
}

TEST(Rotation, LogarithmInvertsExponential) {
  Random random(5);
  for (int k = 0; k < 100000; ++k) {
    const double size = std::pow(10.0, random.uniform(-9, 0.49));
    const Vector3 r = size * random.point(1.0).normalized();
    ASSERT_LT((logRotation(expRotation(r)) - r).norm(), 1e-9 * (1.0 + size));
    const Quaternion q = random.rotation();
    const Quaternion minus(-q.w(), -q.x(), -q.y(), -q.z());
    ASSERT_LT((logRotation(q) - logRotation(minus)).norm(), 1e-9);
    ASSERT_LT(q.angularDistance(expRotation(logRotation(q))), 1e-7);
  }
  EXPECT_TRUE(logRotation(Quaternion::Identity()).isZero(0.0));
}

TEST(Rotation, TheShortestTurnTurnsOneDirectionIntoTheOther) {
  Random random(5);
  const auto direction = [&] { return random.point(1.0); };
  for (int i = 0; i < 3000; ++i) {
    const Vector3 from = direction();
    // Any direction, one nearly the same, one nearly or exactly opposite.
    const Vector3 to = i % 3 == 0 ? direction()
                       : i % 3 == 1
                           ? Vector3(2.0 * from + 1e-9 * direction())
                           : Vector3(-3.0 * from + std::pow(10.0, -(i % 20)) * direction());
    const Quaternion turn = shortestTurn(from, to);
    EXPECT_NEAR(turn.norm(), 1.0, 1e-12);
    EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 1e-7) << i;
    EXPECT_LT(std::abs(turn.vec().dot(from)), 1e-6 * from.norm()) << "a turn about another axis";
  }
  for (const Vector3& axis : {Vector3::UnitX(), Vector3::UnitY(), Vector3::UnitZ()}) {
    EXPECT_LT((shortestTurn(axis, -axis) * axis + axis).norm(), 1e-12);
  }
}
