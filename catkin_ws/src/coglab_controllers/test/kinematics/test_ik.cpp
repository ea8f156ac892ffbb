// Eq. (6)-(12): priorities, limits, singularities, second tasks.
#include <gtest/gtest.h>

#include <Eigen/SVD>

#include "coglab_controllers/ik/small_svd.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

IkParameters unlimited() {
  IkParameters parameters;
  parameters.velocity_limit.setConstant(99.0);
  return parameters;
}

CartesianReference randomReference(Random& random, const ChainState& state, double speed) {
  CartesianReference reference;
  reference.pose.position = state.tool.position + random.point(0.005);
  reference.pose.orientation = expRotation(random.point(0.02)) * state.tool.orientation;
  reference.velocity = random.point(speed);
  reference.angular_velocity = random.point(2.0 * speed);
  return reference;
}

}  // namespace

TEST(TwoTaskIk, EqualsTheEquationsWithASingularValueDecomposition) {
  Random random(2);
  const IkParameters parameters = unlimited();
  const TwoTaskIk ik(parameters);
  int compared = 0;
  for (int k = 0; k < 20000; ++k) {
    const JointVector q = random.posture(0.0);
    const ChainState state = robot().evaluate(q);
    const CartesianReference reference = randomReference(random, state, 0.1);
    IkResult result;
    ik.solve(state, q, reference, result);

    using Dynamic = Eigen::MatrixXd;
    const Dynamic position = state.jacobian.topRows<3>(), rotation = state.jacobian.bottomRows<3>();
    const auto pinv = [](const Dynamic& a) {
      return Dynamic(a.completeOrthogonalDecomposition().pseudoInverse());
    };
    const Vector3 xd = reference.velocity + 20.0 * (reference.pose.position - state.tool.position);
    const Vector3 wd = reference.angular_velocity +
                       20.0 * rotationBetween(state.tool.orientation, reference.pose.orientation);
    const Eigen::VectorXd first = pinv(position) * xd;
    const Dynamic null_space = Dynamic::Identity(7, 7) - pinv(position) * position;
    const Dynamic projected = rotation * null_space;
    const double smallest = Eigen::JacobiSVD<Dynamic>(projected).singularValues()[2];
    const double stretched = Eigen::JacobiSVD<Dynamic>(position).singularValues()[2];
    if (stretched < 0.02) continue;
    ASSERT_NEAR(result.smallest_singular_value_rotation, smallest, 1e-9);
    ASSERT_NEAR(result.smallest_singular_value_position, stretched, 1e-9);
    ASSERT_EQ(result.rotation_rejected, smallest < 0.05);
    Eigen::VectorXd expected = first;
    if (smallest >= 0.05) expected += pinv(projected) * (wd - rotation * first);
    if ((expected.array().abs() > 98.0).any()) continue;
    ASSERT_LT((expected - result.velocity).norm(), 1e-8 * (1.0 + expected.norm()));
    ++compared;
  }
  EXPECT_GT(compared, 15000);
}

TEST(TwoTaskIk, TheSecondTaskNeverDisturbsTheTranslation) {
  Random random(3);
  const TwoTaskIk ik(unlimited());
  for (int k = 0; k < 50000; ++k) {
    const JointVector q = random.posture(0.0);
    const ChainState state = robot().evaluate(q);
    const CartesianReference reference = randomReference(random, state, 0.3);
    IkResult result;
    ik.solve(state, q, reference, result);
    const Vector3 disturbance = state.jacobian.topRows<3>() * result.rotation_velocity;
    ASSERT_LT(disturbance.norm(), 1e-10 * (1.0 + result.rotation_velocity.norm()));
  }
}

TEST(TwoTaskIk, StaysInsideTheSpeedLimits) {
  Random random(4);
  IkParameters parameters;
  parameters.velocity_limit << 1.92, 1.92, 1.96, 1.96, 2.27, 1.96, 1.96;
  for (const bool rotation_first : {true, false}) {
    parameters.rotation_first_scaling = rotation_first;
    const TwoTaskIk ik(parameters);
    for (int k = 0; k < 50000; ++k) {
      const JointVector q = random.posture(0.0);
      const ChainState state = robot().evaluate(q);
      const CartesianReference reference = randomReference(random, state, 1.0);
      IkResult result;
      ik.solve(state, q, reference, result);
      ASSERT_LE((result.velocity.array().abs() / parameters.velocity_limit.array()).maxCoeff(),
                1.0 + 1e-12);
      ASSERT_LT((result.velocity - result.position_velocity - result.rotation_velocity).norm(),
                1e-9);
      if (!rotation_first) {
        ASSERT_EQ(result.second_task_scale, 1.0);
      }
      // The whole vector is scaled only if the translation alone cannot be met.
      if (rotation_first && result.scale < 1.0 - 1e-9) {
        const JointVector alone = result.position_velocity / result.scale;
        ASSERT_GE((alone.array().abs() / parameters.velocity_limit.array()).maxCoeff(), 1.0 - 1e-9);
      }
    }
  }
}

TEST(TwoTaskIk, DropsTheSecondTaskNearASingularity) {
  const TwoTaskIk ik;
  JointVector q;
  q << 0.0, 0.5, 0.0, -1.2, M_PI / 2, 0.0, 0.0;  // wrist stretched, and what is left turns it not
  const ChainState state = robot().evaluate(q);
  CartesianReference reference;
  reference.pose = state.tool;
  reference.velocity = Vector3(0.1, 0.05, 0.0);
  reference.angular_velocity = Vector3(0.0, 0.0, 0.3);
  IkResult result;
  ik.solve(state, q, reference, result);
  ASSERT_LT(result.smallest_singular_value_rotation, 0.05) << "the posture is no singular one";
  EXPECT_TRUE(result.rotation_rejected);
  EXPECT_TRUE(result.rotation_velocity.isZero(0.0));
  EXPECT_LT((state.jacobian.topRows<3>() * result.velocity - reference.velocity).norm(), 1e-9);
}

TEST(TwoTaskIk, AStretchedArmGetsFiniteSpeeds) {
  const TwoTaskIk ik;
  for (const double bend : {0.0, 1e-9, 1e-6, 1e-4, 1e-3, 0.01}) {
    JointVector q = JointVector::Zero();
    q[3] = bend;
    const ChainState state = robot().evaluate(q);
    CartesianReference reference;
    reference.pose = state.tool;
    reference.pose.position.z() -= 0.1;
    IkResult result;
    ik.solve(state, q, reference, result);
    EXPECT_TRUE(result.velocity.allFinite());
    EXPECT_LE(result.velocity.cwiseAbs().maxCoeff(), 1.9 + 1e-9);
  }
}

TEST(TwoTaskIk, OrientationIsFreeOnRequest) {
  const TwoTaskIk ik;
  const JointVector q = Random(5).posture(0.5);
  const ChainState state = robot().evaluate(q);
  CartesianReference reference;
  reference.pose = state.tool;
  reference.velocity = Vector3(0.05, 0, 0);
  reference.angular_velocity = Vector3(1, 0, 0);
  reference.orientation_control = false;
  IkResult result;
  ik.solve(state, q, reference, result);
  EXPECT_TRUE(result.rotation_velocity.isZero(0.0));
  EXPECT_FALSE(result.rotation_rejected);
}

TEST(TwoTaskIk, APostureIsASecondTaskToo) {
  JointVector q, wanted;
  q << 0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1;
  wanted << 0.0, 0.5, 0.8, -1.2, 0.0, 0.8, 0.5;
  const TwoTaskIk ik;
  const PostureTask posture(wanted, 2.0);
  const Vector3 place = robot().evaluate(q).tool.position;
  CartesianReference reference;
  reference.pose.position = place;
  const double before = (q - wanted).norm();
  IkResult result;
  for (int i = 0; i < 2000; ++i) {
    ik.solve(robot().evaluate(q), q, reference, posture, result);
    q += 0.005 * result.velocity;
    ASSERT_LT((robot().evaluate(q).tool.position - place).norm(), 1e-3);
  }
  EXPECT_LT((q - wanted).norm(), 0.8 * before);
  EXPECT_LT(result.velocity.norm(), 1e-3);  // as near as the hand's place allows
}

TEST(TwoTaskIk, OneAxisOfTheHandIsASecondTaskToo) {
  Random random(12);
  const TwoTaskIk ik(unlimited());
  const Vector3 axis = Vector3(1.0, 0.3, 0.0);
  const AxisTask task(axis, 20.0);
  int judged = 0, turned_about_it = 0;
  for (int k = 0; k < 200; ++k) {
    JointVector q = random.posture(0.3);
    const ChainState begin = robot().evaluate(q);
    CartesianReference reference;
    reference.pose = begin.tool;
    reference.orientation_control = true;
    reference.pose.orientation =
        (expRotation(random.point(0.3)) * begin.tool.orientation).normalized();
    IkResult result;
    bool rejected = false;
    for (int i = 0; i < 400; ++i) {
      ik.solve(robot().evaluate(q), q, reference, task, result);
      rejected = rejected || result.rotation_rejected;
      q += 0.002 * result.velocity;
    }
    if (rejected) continue;
    ++judged;
    const Pose hand = robot().evaluate(q).tool;
    EXPECT_LT((hand.position - begin.tool.position).norm(), 1e-3);
    const Vector3 now = hand.orientation * axis, wanted = reference.pose.orientation * axis;
    EXPECT_LT(now.cross(wanted).norm(), 1e-3) << k;
    turned_about_it += hand.orientation.angularDistance(reference.pose.orientation) > 0.02 ? 1 : 0;
  }
  EXPECT_GT(judged, 100);
  EXPECT_GT(turned_about_it, judged / 2) << "the rotation about the axis has to stay free";
}

TEST(TwoTaskIk, WithoutASecondTaskTheHandMovesStraightAndTurnsFreely) {
  const TwoTaskIk ik(unlimited());
  Random random(13);
  const ChainState state = robot().evaluate(random.posture(0.5));
  CartesianReference reference = randomReference(random, state, 0.05);
  reference.orientation_control = true;
  IkResult result;
  ik.solve(state, JointVector::Zero(), reference, NoTask(), result);
  EXPECT_TRUE(result.rotation_velocity.isZero(0.0));
  EXPECT_EQ(result.velocity, result.position_velocity);
}

TEST(TwoTaskIk, AnArmOfSixJointsKeepsTheSeventhStill) {
  // The robot without its third axis.
  std::string urdf = robotUrdf();
  const auto at = urdf.find("<joint name=\"lwr_e1\" type=\"revolute\"");
  ASSERT_NE(at, std::string::npos);
  urdf.replace(at, std::string("<joint name=\"lwr_e1\" type=\"revolute\"").size(),
               "<joint name=\"lwr_e1\" type=\"fixed\"");
  const Chain six(urdf, "lwr_base_link", "ih2_palm");
  ASSERT_EQ(six.joints(), 6);
  const TwoTaskIk ik(unlimited());
  Random random(6);
  for (int k = 0; k < 1000; ++k) {
    const JointVector q = random.posture(0.2);
    const ChainState state = six.evaluate(q);
    const CartesianReference reference = randomReference(random, state, 0.05);
    IkResult result;
    ik.solve(state, q, reference, result);
    EXPECT_EQ(result.velocity[6], 0.0);
    if (result.rotation_rejected || result.smallest_singular_value_position < 0.02 ||
        result.scale < 1.0)
      continue;
    const Eigen::Matrix<double, 6, 1> twist = state.jacobian * result.velocity;
    const Vector3 wanted = reference.velocity + 20.0 * result.position_error;
    EXPECT_LT((twist.head<3>() - wanted).norm(), 1e-8);
  }
}

TEST(TwoTaskIk, CorrectsErrorsOnlyWithSpeedsTheJointsCanBrakeFrom) {
  Random random(8);
  IkParameters parameters = unlimited();
  parameters.acceleration_limit.setConstant(10.0);
  parameters.jerk_limit.setConstant(500.0);
  const TwoTaskIk braking(parameters), plain(unlimited());
  double least = 1.0;
  for (int k = 0; k < 20000; ++k) {
    const JointVector q = random.posture(0.1);
    const ChainState state = robot().evaluate(q);
    CartesianReference reference;
    const double size = k % 2 == 0 ? 1.0 : 0.001;
    reference.pose.position = state.tool.position + random.point(0.1 * size);
    reference.pose.orientation = expRotation(random.point(0.5 * size)) * state.tool.orientation;
    IkResult slow, fast;
    braking.solve(state, q, reference, slow);
    plain.solve(state, q, reference, fast);
    if (fast.scale < 1.0 || fast.second_task_scale < 1.0) continue;
    // Half the deceleration for the translation's part; the way is what K_pos would take away.
    const JointVector way = fast.position_velocity / 20.0;
    for (int i = 0; i < kMaxJoints; ++i) {
      const double v = slow.position_velocity[i];
      ASSERT_LE(v * v, 2.0 * 5.0 * std::abs(way[i]) * (1.0 + 1e-9) + 1e-12);
    }
    if (fast.position_velocity.norm() < 1e-9) continue;
    const double share = slow.position_velocity.norm() / fast.position_velocity.norm();
    least = std::min(least, share);
    ASSERT_LT((slow.position_velocity - share * fast.position_velocity).norm(),
              1e-9 * (1.0 + fast.position_velocity.norm()));  // the direction is kept
    if (way.lpNorm<Eigen::Infinity>() < 0.002) {
      ASSERT_NEAR(share, 1.0, 1e-9);  // small errors see the gain of eq. (6)
    }
  }
  EXPECT_LT(least, 0.5);
}

TEST(TwoTaskIk, CorrectsAPositionErrorWithinItsLargestSpeed) {
  Random random(9);
  IkParameters parameters = unlimited();
  parameters.correction_speed = 0.3;
  const TwoTaskIk gentle(parameters), plain(unlimited());
  int slowed = 0;
  for (int k = 0; k < 2000; ++k) {
    const JointVector q = random.posture(0.1);
    const ChainState state = robot().evaluate(q);
    CartesianReference reference;
    reference.orientation_control = false;
    reference.pose = state.tool;
    reference.pose.position += random.point(k % 2 == 0 ? 0.1 : 0.01);
    IkResult slow, fast;
    gentle.solve(state, q, reference, slow);
    plain.solve(state, q, reference, fast);
    if (fast.scale < 1.0 || fast.smallest_singular_value_position < 0.01) continue;
    const double speed = (state.jacobian.topRows<3>() * slow.velocity).norm();
    const double eq6 = 20.0 * fast.position_error.norm();
    ASSERT_NEAR(speed, std::min(0.3, eq6), 1e-6);
    if (eq6 <= 0.3) ASSERT_LT((slow.velocity - fast.velocity).norm(), 1e-12);
    slowed += eq6 > 0.3 ? 1 : 0;
  }
  EXPECT_GT(slowed, 200);
}

TEST(TwoTaskIk, RefusesBadParameters) {
  IkParameters parameters;
  parameters.pos_clik_gain = std::nan("");
  EXPECT_THROW(TwoTaskIk{parameters}, std::invalid_argument);
  parameters = {};
  parameters.velocity_limit[3] = 0.0;
  EXPECT_THROW(TwoTaskIk{parameters}, std::invalid_argument);
  parameters = {};
  parameters.singularity_threshold = -1.0;
  EXPECT_THROW(TwoTaskIk{parameters}, std::invalid_argument);
  parameters = {};
  parameters.correction_speed = 0.0;
  EXPECT_THROW(TwoTaskIk{parameters}, std::invalid_argument);
  EXPECT_THROW(OrientationTask(-1.0), std::invalid_argument);
  EXPECT_THROW(AxisTask(Vector3::Zero(), 1.0), std::invalid_argument);
  EXPECT_THROW(AxisTask(Vector3::UnitX(), std::nan("")), std::invalid_argument);
}
