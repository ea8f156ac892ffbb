// Values of the cores that others count on: defaults, words, indices, and limits that hold nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/dmp/motion_end.hpp"
#include "coglab_controllers/goal/goal_estimator.hpp"
#include "coglab_controllers/goal/goal_watch.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/ptp/ptp_trajectory.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

/// A second task as told.
class ToldTask : public SecondTask {
 public:
  void evaluate(const ChainState&, const JointVector&, const CartesianReference&,
                TaskConstraint& constraint) const noexcept override {
    constraint = told;
  }
  TaskConstraint told;
};

}  // namespace

TEST(Chain, ElbowAndWristAreTheMiddleAndTheEndOfTheArm) {
  std::string urdf = robotUrdf();
  const std::string third = "<joint name=\"lwr_e1\" type=\"revolute\"";
  urdf.replace(urdf.find(third), third.size(), "<joint name=\"lwr_e1\" type=\"fixed\"");
  const Chain six(urdf, "lwr_base_link", "ih2_palm");
  EXPECT_EQ(robot().elbowJoint(), 3);
  EXPECT_EQ(robot().wristJoint(), 5);
  EXPECT_EQ(robot().baseLink(), "lwr_base_link");
  ASSERT_EQ(six.joints(), 6);
  EXPECT_EQ(six.elbowJoint(), 2);
  EXPECT_EQ(six.wristJoint(), 4);
  EXPECT_NEAR(six.reach(), robot().reach(), 1e-9);
  // Elbow and wrist are where these origins are, the upper arm and the forearm away.
  const ChainState state = robot().evaluate(JointVector::Zero());
  EXPECT_NEAR((state.origins.col(5) - state.origins.col(1)).norm(), 0.79, 1e-9);
  const ChainState of_six = six.evaluate(JointVector::Zero());
  EXPECT_LT((of_six.origins.col(2) - state.origins.col(3)).norm(), 1e-9);
  EXPECT_TRUE(of_six.origins.col(6).isZero(0.0));
  EXPECT_TRUE(of_six.axes.col(6).isZero(0.0));
}

TEST(Chain, WithoutTimeOrSpeedTheJacobianIsThatOfNow) {
  const JointVector q = Random(3).posture(0.4), speed = JointVector::Constant(1.0);
  const ChainState now = robot().evaluate(q);
  ChainState state;
  robot().evaluate(q, speed, 0.0, state);
  EXPECT_EQ(state.jacobian, now.jacobian);
  robot().evaluate(q, speed, -0.1, state);
  EXPECT_EQ(state.jacobian, now.jacobian);
  robot().evaluate(q, JointVector::Zero(), 0.1, state);
  EXPECT_EQ(state.jacobian, now.jacobian);
  robot().evaluate(q, speed, 0.02, state);
  EXPECT_EQ(state.jacobian, robot().evaluate(q + 0.01 * speed).jacobian);
  EXPECT_EQ(state.tool.orientation.coeffs(), now.tool.orientation.coeffs());
}

TEST(Rotation, UnitMeansFiniteAndWithinAThousandth) {
  for (const double norm : {0.9991, 1.0, 1.0009}) EXPECT_TRUE(isUnit(Quaternion(norm, 0, 0, 0)));
  for (const double norm : {0.9989, 1.0011, 0.0}) EXPECT_FALSE(isUnit(Quaternion(norm, 0, 0, 0)));
  EXPECT_FALSE(isUnit(Quaternion(1.0, std::nan(""), 0, 0)));
  EXPECT_FALSE(isUnit(Quaternion(INFINITY, 0, 0, 0)));
}

TEST(Workspace, BordersThatAreSwitchedOffAreFarAwayAndStill) {
  WorkspaceParameters parameters;
  parameters.base_radius = 0.0;
  parameters.max_stretch = 1.0;
  const JointVector q = Random(3).posture(0.4);
  std::array<Workspace::Margin, Workspace::kBorders> margins;
  Workspace(parameters, robot().reach())
      .margins(robot(), robot().evaluate(q), JointVector::Constant(0.5), margins);
  for (const int border : {6, 7}) {
    EXPECT_GE(margins[border].distance, 100.0) << border;
    EXPECT_EQ(margins[border].rate, 0.0) << border;
    EXPECT_EQ(margins[border].border, WorkspaceBorder::None) << border;
  }
  const ChainState state = robot().evaluate(q);
  Workspace({}, robot().reach()).margins(robot(), state, JointVector::Zero(), margins);
  EXPECT_EQ(margins[6].border, WorkspaceBorder::BaseSphere);
  EXPECT_NEAR(margins[6].distance, (state.tool.position - Vector3(0, 0, 0.2)).norm() - 0.25, 1e-12);
  EXPECT_EQ(margins[7].border, WorkspaceBorder::Stretch);
  const double arm = (state.origins.col(5) - state.origins.col(1)).norm();
  EXPECT_NEAR(margins[7].distance, 0.98 * 0.79 - arm, 1e-9);
  for (int axis = 0; axis < 3; ++axis) {
    const double low = axis == 2 ? 0.0 : -1.2, high = axis == 2 ? 1.6 : 1.2;
    EXPECT_NEAR(margins[2 * axis].distance, state.tool.position[axis] - low, 1e-12);
    EXPECT_EQ(margins[2 * axis].border, WorkspaceBorder::BoxMin);
    EXPECT_NEAR(margins[2 * axis + 1].distance, high - state.tool.position[axis], 1e-12);
    EXPECT_EQ(margins[2 * axis + 1].border, WorkspaceBorder::BoxMax);
  }
}

TEST(Guard, KeepsWhatTheInterfaceOfTheRobotNeeds) {
  Guard guard(GuardParameters(), robot());
  const auto speed = [](double room, double lag) {
    return 10.0 * (std::sqrt(lag * lag + 2.0 * room / 10.0) - lag);
  };
  const double lag = 1.5 * 10.0 / 500.0 + 0.015;
  EXPECT_NEAR(guard.speedToStop(2, 0.3), speed(0.29, lag), 1e-12);
  guard.setInterfaceReserve(0.02, 0.001);
  EXPECT_NEAR(guard.speedToStop(2, 0.3), speed(0.289, lag + 0.02), 1e-12);
  EXPECT_EQ(guard.speedToStop(2, 0.011), 0.0);
  const auto refusal = [](double GuardParameters::*field, double value) -> std::string {
    GuardParameters parameters;
    parameters.*field = value;
    try {
      Guard(parameters, robot());
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  for (const double bad : {0.0, -1.0, std::nan("")}) {
    EXPECT_NE(refusal(&GuardParameters::workspace_deceleration, bad).find("workspace_deceleration"),
              std::string::npos);
  }
  EXPECT_EQ(refusal(&GuardParameters::reaction_time, 0.0), "");
}

TEST(Guard, ReasonsAndBordersHaveTheirWords) {
  const std::pair<GuardReason, const char*> reasons[] = {
      {GuardReason::None, "not limited"},
      {GuardReason::JointVelocity, "joint speed limit"},
      {GuardReason::JointPosition, "joint position limit"},
      {GuardReason::HandSpeed, "Cartesian speed limit of the hand"},
      {GuardReason::ElbowSpeed, "Cartesian speed limit of the elbow"},
      {GuardReason::WorkspaceBorder, "workspace border"},
      {GuardReason::NotFinite, "velocity that is not a finite number"}};
  for (const auto& [reason, words] : reasons) EXPECT_STREQ(describe(reason), words);
  const std::pair<WorkspaceBorder, const char*> borders[] = {
      {WorkspaceBorder::None, "inside the workspace"},
      {WorkspaceBorder::BoxMin, "lower side of the workspace box"},
      {WorkspaceBorder::BoxMax, "upper side of the workspace box"},
      {WorkspaceBorder::BaseSphere, "sphere around the base"},
      {WorkspaceBorder::Stretch, "arm fully stretched"}};
  for (const auto& [border, words] : borders) EXPECT_STREQ(describe(border), words);
}

TEST(Defaults, OfTheLimitsAreTheDocumentedOnes) {
  const GuardParameters guard;
  EXPECT_EQ(guard.lower_position, JointVector::Constant(-2.0));
  EXPECT_EQ(guard.upper_position, JointVector::Constant(2.0));
  EXPECT_EQ(guard.velocity, JointVector::Constant(1.9));
  EXPECT_EQ(guard.acceleration, JointVector::Constant(10.0));
  EXPECT_EQ(guard.jerk, JointVector::Constant(500.0));
  EXPECT_EQ(guard.position_margin, 0.01);
  EXPECT_EQ(guard.hand_speed, 1.0);
  EXPECT_EQ(guard.elbow_speed, 1.0);
  EXPECT_EQ(guard.workspace_deceleration, 2.0);
  EXPECT_EQ(guard.reaction_time, 0.015);
  const GuardResult result;
  EXPECT_EQ(result.scale, 1.0);
  EXPECT_EQ(result.joint, -1);
  const Workspace::Margin margin;
  EXPECT_EQ(margin.distance, 0.0);
  EXPECT_EQ(margin.rate, 0.0);
}

TEST(Defaults, OfTheInverseKinematicsAreTheDocumentedOnes) {
  const IkParameters ik;
  EXPECT_EQ(ik.pos_clik_gain, 20.0);
  EXPECT_EQ(ik.rot_clik_gain, 20.0);
  EXPECT_EQ(ik.correction_speed, std::numeric_limits<double>::infinity());
  EXPECT_EQ(ik.singularity_threshold, 0.05);
  EXPECT_EQ(ik.stretch_threshold, 0.01);
  EXPECT_TRUE(ik.rotation_first_scaling);
  EXPECT_EQ(ik.velocity_limit, JointVector::Constant(1.9));
  EXPECT_EQ(ik.reaction_time, 0.015);
  const IkResult result;
  EXPECT_EQ(result.scale, 1.0);
  EXPECT_EQ(result.second_task_scale, 1.0);
  EXPECT_EQ(result.smallest_singular_value_position, 0.0);
  EXPECT_EQ(result.smallest_singular_value_rotation, 0.0);
  EXPECT_FALSE(result.rotation_rejected);
  const TaskConstraint constraint;
  EXPECT_EQ(constraint.rows, 0);
  EXPECT_EQ(constraint.gain, 0.0);
  EXPECT_TRUE(constraint.reject_whole);
  EXPECT_TRUE(CartesianReference().orientation_control);
  for (const double bad : {-1e-9, 1.001, std::nan("")}) {
    IkParameters parameters;
    parameters.reaction_time = bad;
    EXPECT_THROW(TwoTaskIk{parameters}, std::invalid_argument) << bad;
  }
  for (const double fine : {0.0, 1.0}) {
    IkParameters parameters;
    parameters.reaction_time = fine;
    EXPECT_NO_THROW(TwoTaskIk{parameters}) << fine;
  }
}

TEST(Defaults, OfGoalAndEndAreTheDocumentedOnes) {
  const GoalEstimatorParameters estimator;
  EXPECT_EQ(estimator.time_constant, 0.06);
  EXPECT_EQ(estimator.noisy_time_constant, 0.10);
  EXPECT_EQ(estimator.noisy_turning_time_constant, 0.30);
  EXPECT_EQ(estimator.noisy_speed, 0.04);
  EXPECT_EQ(estimator.noisy_turning, 2.0);
  EXPECT_EQ(estimator.predicted_speed, 0.08);
  EXPECT_EQ(estimator.max_speed, 0.15);
  EXPECT_EQ(estimator.max_innovation, 0.15);
  EXPECT_EQ(estimator.max_angle_innovation, 0.6);
  const MotionEndParameters end;
  EXPECT_EQ(end.phase, 0.012);
  EXPECT_EQ(end.speed, 0.02);
  EXPECT_EQ(end.turning, 0.2);
  EXPECT_EQ(end.distance, 0.005);
  EXPECT_EQ(end.follow_distance, 0.030);
  EXPECT_EQ(end.follow_time, 0.2);
  const GoalLimits anything;
  EXPECT_EQ(anything.retreat, 0.0);
  EXPECT_EQ(anything.drop, 0.0);
  EXPECT_STREQ(anything.wrong(), "");
  EXPECT_EQ(GoalWatch::kDropTime, 0.15);
}

TEST(Defaults, OfAPrimitiveThatNobodyLearntIsASpringWithoutShape) {
  const TransformationSystem system;
  EXPECT_EQ(system.duration(), 1.0);
  EXPECT_EQ(system.stiffness(), 150.0);
  EXPECT_NEAR(system.damping(), 2.0 * std::sqrt(150.0), 1e-12);
  EXPECT_NEAR(system.canonical().alpha(), std::log(100.0), 1e-14);
  EXPECT_TRUE(system.movingPoint(0.5).isZero(0.0));
  EXPECT_EQ(system.goalWeight(0.3), 0.7);
  for (const double w : {0.0, 0.25, 0.5, 0.8, 1.0}) {
    EXPECT_NEAR(TransformationSystem::velocityWeight(w), 3 * w * w - 2 * w * w * w, 1e-15);
  }
  EXPECT_EQ(Dmp().tau(), 1.0);
  EXPECT_EQ(Dmp().state().phase, 0.0);
  EXPECT_NO_THROW(CanonicalSystem(50.0));
  for (const double bad : {0.0, -1.0, 50.001}) {
    EXPECT_THROW(CanonicalSystem{bad}, std::invalid_argument) << bad;
  }
  Random random(2);
  for (const auto& [count, packets] : {std::pair(2, 4), {4, 4}, {5, 8}, {63, 64}, {64, 64}}) {
    Primitive p = randomPrimitive(random);
    placeBasis(count, p.alpha, p.centres, p.widths);
    p.weights = Eigen::Matrix3Xd::Constant(3, count, 0.2);
    const TransformationSystem made(p);
    EXPECT_EQ(made.basisCount(), packets);
    for (const double s : {0.0, 0.4, 1.0}) {
      EXPECT_LT((made.movingPoint(s) - Vector3::Constant(0.2)).norm(), 1e-12) << "a mean of equals";
    }
  }
  PtpPoint point;
  PtpTrajectory().at(0.5, point);
  EXPECT_TRUE(point.position.isZero(0.0) && point.velocity.isZero(0.0));
  EXPECT_EQ(PtpTrajectory().duration(), 0.0);
}

TEST(ShapeMap, LinesShorterThanAMillimetreHaveNoDirection) {
  const Vector3 x = Vector3::UnitX(), y = Vector3::UnitY(), z = Vector3::UnitZ();
  EXPECT_TRUE(shapeMap(ShapeMapping::Similarity, 0.9e-3 * x, y).isIdentity());
  EXPECT_LT((shapeMap(ShapeMapping::Similarity, 1.1e-3 * x, y) * (1.1e-3 * x) - y).norm(), 1e-9);
  EXPECT_TRUE(shapeMap(ShapeMapping::Upright, x, 0.9e-9 * y).isZero());
  EXPECT_LT((shapeMap(ShapeMapping::Similarity, x, 1.1e-9 * y) * x - 1.1e-9 * y).norm(), 1e-18);
  // A line that is nearly vertical has no level part to turn about the vertical.
  for (const double level : {0.9e-3, 1.1e-3}) {
    const Matrix3 map = shapeMap(ShapeMapping::Upright, z + level * x, z + 0.5 * y);
    const Matrix3 similar = shapeMap(ShapeMapping::Similarity, z + level * x, z + 0.5 * y);
    EXPECT_EQ((map - similar).norm() < 1e-9, level < 1e-3) << level;
    const Matrix3 back = shapeMap(ShapeMapping::Upright, z + 0.5 * y, z + level * x);
    const Matrix3 other = shapeMap(ShapeMapping::Similarity, z + 0.5 * y, z + level * x);
    EXPECT_EQ((back - other).norm() < 1e-9, level < 1e-3) << level;
  }
}

TEST(TwoTaskIk, ATranslationAtTheLimitOfAJointLeavesTheSecondTaskExactlyWhatIsFree) {
  JointVector q;
  q << 0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1;
  const ChainState state = robot().evaluate(q);
  CartesianReference reference;
  reference.pose = state.tool;
  reference.velocity = Vector3(0.1, 0.05, -0.02);
  reference.orientation_control = false;
  IkParameters parameters;
  parameters.velocity_limit.setConstant(99.0);
  IkResult free, bound;
  TwoTaskIk(parameters).solve(state, q, reference, free);
  int fastest = 0;
  const double speed = free.velocity.cwiseAbs().maxCoeff(&fastest);
  parameters.velocity_limit[fastest] = speed;
  TwoTaskIk(parameters).solve(state, q, reference, bound);
  EXPECT_EQ(bound.second_task_scale, 1.0) << "nothing is too fast";
  EXPECT_EQ(bound.scale, 1.0);
  ToldTask outward;
  outward.told.rows = kMaxJoints;
  outward.told.jacobian.setIdentity();
  outward.told.velocity[fastest] = std::copysign(1.0, free.velocity[fastest]);
  outward.told.reject_whole = false;
  TwoTaskIk(parameters).solve(state, q, reference, outward, bound);
  EXPECT_EQ(bound.second_task_scale, 0.0);
  EXPECT_EQ(bound.velocity, free.velocity);
  parameters.velocity_limit[fastest] = 0.5 * speed;
  TwoTaskIk(parameters).solve(state, q, reference, bound);
  EXPECT_LT(bound.second_task_scale, 1e-6);
  EXPECT_NEAR(bound.scale, 0.5, 1e-12);
}

TEST(SecondTask, FillsAConstraintThatWasUsedBefore) {
  const JointVector q = Random(4).posture(0.4), wanted = Random(5).posture(0.4);
  const ChainState state = robot().evaluate(q);
  CartesianReference reference;
  reference.pose.orientation = expRotation(Vector3(0.1, 0.2, -0.3)) * state.tool.orientation;
  reference.angular_velocity = Vector3(0.3, -0.2, 0.1);
  TaskConstraint used;
  used.rows = 5;
  used.jacobian.setConstant(9.0);
  used.velocity = used.error = JointVector::Constant(9.0);
  used.gain = 9.0;
  used.reject_whole = false;
  OrientationTask(3.0).evaluate(state, q, reference, used);
  EXPECT_EQ(used.rows, 3);
  EXPECT_TRUE(used.reject_whole);
  EXPECT_TRUE(used.jacobian.topRows<3>() == state.jacobian.bottomRows<3>());
  EXPECT_TRUE(used.velocity.head<3>() == reference.angular_velocity);
  EXPECT_LT((used.error.head<3>() - Vector3(0.1, 0.2, -0.3)).norm(), 1e-9);
  EXPECT_EQ(used.gain, 3.0);
  PostureTask(wanted, 2.0).evaluate(state, q, reference, used);
  EXPECT_EQ(used.rows, kMaxJoints);
  EXPECT_FALSE(used.reject_whole);
  EXPECT_TRUE(used.jacobian.isIdentity(0.0));
  EXPECT_TRUE(used.velocity.isZero(0.0));
  EXPECT_TRUE(used.error == wanted - q);
  EXPECT_EQ(used.gain, 2.0);
}

TEST(TwoTaskIk, SaysWhichParameterIsOutOfWhichRange) {
  const auto refusal = [](auto&& change) -> std::string {
    IkParameters parameters;
    change(parameters);
    try {
      TwoTaskIk{parameters};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal([](IkParameters& p) { p.pos_clik_gain = 501.0; }),
            "pos_clik_gain: expected a number from 0.000000 to 500.000000, got 501.000000");
  EXPECT_EQ(refusal([](IkParameters& p) { p.velocity_limit[6] = 0.0; }),
            "velocity_limit[6]: expected a number from 0.001000 to 100.000000, got 0.000000");
  EXPECT_EQ(refusal([](IkParameters& p) { p.rot_clik_gain = -1.0; }),
            "rot_clik_gain: expected a gain of at least 0 1/s, got -1.000000");
}

TEST(Workspace, ASphereThatReachesTheCornersLeavesNoRoomAndItsCentreHasNoWayOut) {
  WorkspaceParameters parameters;
  parameters.box_max = Vector3(1.0, 2.0, 2.0);
  parameters.box_min = -parameters.box_max;
  parameters.base_centre.setZero();
  parameters.base_radius = 3.0;
  EXPECT_THROW(Workspace{parameters}, std::invalid_argument);
  parameters.base_radius = 2.9999;
  EXPECT_NO_THROW(Workspace{parameters});
  const JointVector q = Random(3).posture(0.4);
  const ChainState state = robot().evaluate(q);
  parameters.base_centre = state.tool.position;
  parameters.base_radius = 0.25;
  std::array<Workspace::Margin, Workspace::kBorders> margins;
  Workspace(parameters).margins(robot(), state, JointVector::Constant(0.5), margins);
  EXPECT_EQ(margins[6].distance, -0.25);
  EXPECT_EQ(margins[6].rate, 0.0);
}
