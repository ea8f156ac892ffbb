// Joint trajectories: the arm follows them within its limits, what ends them, and what is refused.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "coglab_controllers/plugins/joint_trajectory.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"
#include "motion_types.hpp"

namespace coglab_controllers {
namespace {

using Numbers = std::vector<double>;

Numbers list(const JointVector& joints) { return {joints.data(), joints.data() + 7}; }

/// The arm's home posture with some joints elsewhere.
JointVector home(double a1, double a6 = 0.0) {
  JointVector joints = kHome;
  joints[0] += a1;
  joints[6] += a6;
  return joints;
}

struct Following : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "]}"};
  JointTrajectory* controller = nullptr;

  void SetUp() override {
    arm.followWithinLimits();
    std::string active;
    ASSERT_TRUE(arm.manager->load("trajectory", "coglab/JointTrajectory").success);
    ASSERT_TRUE(arm.manager->switchTo("trajectory", active).success);
    controller = dynamic_cast<JointTrajectory*>(arm.manager->motion("trajectory"));
    ASSERT_NE(controller, nullptr);
  }

  /// Through these postures, one second apart; the first one at once.
  TrajectoryRequest through(const std::vector<JointVector>& postures) const {
    TrajectoryRequest request;
    request.joint_names = controller->jointNames();
    for (const JointVector& posture : postures) {
      const double time = static_cast<double>(request.points.size());
      request.points.push_back({time, list(posture), {}, {}});
    }
    return request;
  }
  /// Runs to the end of the motion, at most so many seconds; the fastest step of speed is watched.
  EndedMotion runToEnd(double seconds = 20.0) {
    EndedMotion end;
    while (!controller->readEnd(end) && seconds > 0.0) {
      const JointVector before = arm.sample.velocity;
      arm.tick();
      seconds -= arm.period;
      const JointVector change = (arm.sample.velocity - before).cwiseAbs() / arm.period;
      steepest = std::max(steepest, change.maxCoeff());
    }
    EXPECT_GT(seconds, 0.0) << "no end";
    return end;
  }
  void expectRefused(const TrajectoryRequest& request, TrajectoryError error,
                     const std::string& words, const std::string& more = "") {
    const TrajectoryAnswer answer = controller->follow(request);
    EXPECT_FALSE(answer.success);
    EXPECT_EQ(static_cast<int>(answer.error), static_cast<int>(error)) << answer.message;
    EXPECT_NE(answer.message.find(words), std::string::npos) << answer.message;
    EXPECT_NE(answer.message.find(more), std::string::npos) << answer.message;
    arm.run(0.05);
    EXPECT_TRUE(arm.manager->report().standing);
  }

  double steepest = 0.0;  // rad/s^2
};

TEST_F(Following, GoesThroughThePointsAtTheirTimes) {
  const TrajectoryRequest request =
      through({home(0.0), home(0.3, 0.2), home(0.5, 0.4), home(0.5, 0.2)});
  ASSERT_TRUE(controller->follow(request).success);
  for (int k = 1; k < 4; ++k) {
    arm.run(1.0);
    const Numbers& wanted = request.points[static_cast<std::size_t>(k)].positions;
    EXPECT_NEAR(arm.sample.position[0], wanted[0], 0.02) << k;
    EXPECT_NEAR(arm.sample.position[6], wanted[6], 0.02) << k;
    EXPECT_LE(arm.sample.position[0], kHome[0] + 0.505) << "no overshoot";
  }
  const EndedMotion end = runToEnd();
  EXPECT_TRUE(end.executed) << end.reason.str();
  EXPECT_LT((arm.sample.position - home(0.5, 0.2)).norm(), 0.01);
  arm.run(0.5);
  EXPECT_TRUE(arm.manager->report().standing);
}

TEST_F(Following, GivenVelocitiesAndAccelerationsAreMet) {
  TrajectoryRequest request = through({home(0.0), home(0.3), home(0.8)});
  const Numbers rest(7, 0.0);
  for (auto& point : request.points) point.velocities = point.accelerations = rest;
  request.points[1].velocities[0] = 0.6;
  ASSERT_TRUE(controller->follow(request).success);
  arm.run(1.03);
  EXPECT_NEAR(arm.sample.velocity[0], 0.6, 0.03);
  EXPECT_TRUE(runToEnd().executed);
  EXPECT_LE(steepest, 10.0 + 1e-6);
}

TEST_F(Following, JointsMayComeInAnyOrder) {
  TrajectoryRequest request = through({home(0.3)});
  request.points[0].time = 2.0;
  std::reverse(request.joint_names.begin(), request.joint_names.end());
  std::reverse(request.points[0].positions.begin(), request.points[0].positions.end());
  ASSERT_TRUE(controller->follow(request).success);
  EXPECT_TRUE(runToEnd().executed);
  EXPECT_NEAR(arm.sample.position[0], kHome[0] + 0.3, 0.01);
}

TEST_F(Following, ANewOneTakesOverInMidMotionWithoutAStep) {
  TrajectoryRequest first = through({home(0.8)});
  first.points[0].time = 1.5;
  ASSERT_TRUE(controller->follow(first).success);
  arm.run(0.7);
  ASSERT_GT(arm.sample.velocity[0], 0.3);
  TrajectoryRequest second = through({home(0.2)});
  second.points[0].time = 2.0;
  const TrajectoryAnswer answer = controller->follow(second);
  ASSERT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(runToEnd().reason.code(), ReasonCode::Superseded);
  const EndedMotion end = runToEnd();
  EXPECT_TRUE(end.executed) << end.reason.str();
  EXPECT_EQ(end.id, answer.id);
  EXPECT_NEAR(arm.sample.position[0], kHome[0] + 0.2, 0.01);
  EXPECT_LE(steepest, 10.0 + 1e-6);
}

TEST_F(Following, ACancelBrakes) {
  TrajectoryRequest request = through({home(0.8)});
  request.points[0].time = 1.5;
  ASSERT_TRUE(controller->follow(request).success);
  arm.run(0.7);
  arm.manager->askCancel("trajectory", "enough");
  const EndedMotion end = runToEnd();
  EXPECT_EQ(end.reason.code(), ReasonCode::Cancelled);
  EXPECT_EQ(JointTrajectory::errorOf(end), TrajectoryError::None);
  arm.run(0.5);
  EXPECT_TRUE(arm.manager->report().standing);
  EXPECT_LT(arm.sample.position[0], kHome[0] + 0.7);
}

TEST_F(Following, ASlowClockTakesLongerOnTheSamePath) {
  ASSERT_TRUE(arm.manager->setSpeedScale(0.5).success);
  TrajectoryRequest request = through({home(0.3)});
  request.points[0].time = 1.0;
  request.path_tolerance = {{controller->jointNames()[0], 0.03, 0.0, 0.0}};
  ASSERT_TRUE(controller->follow(request).success);
  arm.run(1.5);
  EXPECT_LT(arm.sample.position[0], kHome[0] + 0.28);
  EXPECT_TRUE(runToEnd().executed);
}

TEST_F(Following, AJointThatLeavesThePathEndsIt) {
  TrajectoryRequest request = through({home(0.8)});
  request.points[0].time = 1.5;
  request.path_tolerance = {{controller->jointNames()[6], 0.05, 0.0, 0.0}};
  ASSERT_TRUE(controller->follow(request).success);
  arm.run(0.3);
  arm.interpolator.reset();  // a person pushes the last joint away
  arm.sample.position[6] += 0.1;
  arm.tick();
  const EndedMotion end = runToEnd();
  EXPECT_EQ(JointTrajectory::errorOf(end), TrajectoryError::PathToleranceViolated);
  EXPECT_NE(end.reason.str().find(" 0.05 rad"), std::string::npos) << end.reason.str();
}

TEST_F(Following, AnArmThatDoesNotArriveInTimeEndsIt) {
  TrajectoryRequest request = through({home(0.4)});
  request.points[0].time = 1.0;
  request.goal_tolerance = {{controller->jointNames()[0], 1e-6, 0.0, 0.0}};
  request.goal_time_tolerance = 0.02;
  ASSERT_TRUE(controller->follow(request).success);
  const EndedMotion end = runToEnd();
  EXPECT_EQ(JointTrajectory::errorOf(end), TrajectoryError::GoalToleranceViolated)
      << end.reason.str();
  EXPECT_NE(end.reason.str().find(" 0.000001 rad"), std::string::npos) << end.reason.str();
}

TEST_F(Following, OneThatBeginsLaterWaitsAndAStopMakesItVoid) {
  WaitingTrajectory waiting{through({home(0.0), home(0.3)}), {}};
  waiting.request.age = -1.0;
  expectRefused(waiting.request, TrajectoryError::InvalidGoal, "begins in 1 s");
  ASSERT_TRUE(controller->accept(waiting).success);
  arm.run(1.0);
  EXPECT_TRUE(arm.manager->report().standing);
  const TrajectoryAnswer begun = controller->follow(waiting);
  ASSERT_TRUE(begun.success) << begun.message;
  EXPECT_TRUE(runToEnd().executed);

  WaitingTrajectory second{through({home(0.3), home(0.0)}), {}};
  second.request.age = -1.0;
  ASSERT_TRUE(controller->accept(second).success);
  arm.manager->askCancel("trajectory", "enough");
  arm.tick();
  const TrajectoryAnswer cancelled = controller->follow(second);
  EXPECT_EQ(cancelled.code, ReasonCode::Cancelled) << cancelled.message;
  ASSERT_TRUE(controller->accept(second).success);
  ++arm.sample.motion_epoch;  // the robot stopped meanwhile
  arm.tick();
  EXPECT_FALSE(controller->follow(second).success);
  arm.run(0.1);
  EXPECT_TRUE(arm.manager->report().standing);
}

TEST_F(Following, APointAtTheStartIsWhereTheArmIs) {
  const TrajectoryRequest there = through({home(0.005)});
  ASSERT_TRUE(controller->follow(there).success);
  EXPECT_TRUE(runToEnd().executed);
  expectRefused(through({home(0.04)}), TrajectoryError::InvalidGoal, "too short");
  TrajectoryRequest quick = through({home(0.045), home(0.045)});
  quick.points[1].time = 0.1;
  expectRefused(quick, TrajectoryError::InvalidGoal, "too short");
  quick.points[1].time = 1.0;
  ASSERT_TRUE(controller->follow(quick).success);
  EXPECT_TRUE(runToEnd().executed);
  EXPECT_LE(steepest, 10.0 + 1e-6);
}

TEST_F(Following, AnInvalidTrajectoryIsRefusedBeforeTheArmMoves) {
  using Error = TrajectoryError;
  const double nan = std::nan("");
  const auto goal = [this](const auto& change) {
    TrajectoryRequest request = through({home(0.0), home(0.3), home(0.4)});
    change(request);
    return request;
  };
  using Request = TrajectoryRequest&;
  expectRefused(goal([](Request r) { r.points.clear(); }), Error::InvalidGoal, "no points");
  expectRefused(goal([](Request r) { r.joint_names.pop_back(); }), Error::InvalidJoints,
                "6 names; expected all 7");
  expectRefused(goal([](Request r) { r.joint_names[2] = "elbow"; }), Error::InvalidJoints,
                "'elbow'");
  expectRefused(goal([](Request r) { r.joint_names[2] = r.joint_names[0]; }), Error::InvalidJoints,
                "twice");
  expectRefused(goal([](Request r) { r.points[1].positions.pop_back(); }), Error::InvalidGoal,
                "positions of point 1", "6 numbers; expected 7");
  expectRefused(goal([](Request r) { r.points[1].velocities.resize(7); }), Error::InvalidGoal,
                "velocities of point 1", "7 numbers; expected 0");
  expectRefused(goal([nan](Request r) { r.points[1].positions[3] = nan; }), Error::InvalidGoal,
                "not finite", "joint lwr_a3");
  expectRefused(goal([](Request r) { r.points[2].time = 0.5; }), Error::InvalidGoal,
                "point 2 is at 0.5 s");
  expectRefused(goal([nan](Request r) { r.points[2].time = nan; }), Error::InvalidGoal, "nan");
  expectRefused(goal([](Request r) { r.points[0].positions[0] += 0.2; }), Error::InvalidGoal,
                "begins 0.2 rad", "joint lwr_a1");
  expectRefused(goal([](Request r) {
                  r.points[2].positions[5] = 2.2;
                  r.points[2].time = 9.0;
                }),
                Error::InvalidGoal, "joint lwr_a5 has position");
  expectRefused(goal([](Request r) { r.points[1].time = 0.1; }), Error::InvalidGoal,
                "make it slower");
  expectRefused(goal([](Request r) {
                  r.points[0].time = 0.005;
                  r.points[0].positions[0] += 0.01;
                }),
                Error::InvalidGoal, "first point");
  // Between the states that are 5 ms apart.
  expectRefused(goal([](Request r) {
                  r.points[1].positions = r.points[0].positions;
                  r.points[2].positions[0] = r.points[1].positions[0] + 0.01;
                  r.points[2].time = r.points[1].time + 0.002;
                }),
                Error::InvalidGoal, "make it slower");
  expectRefused(goal([](Request r) { r.points.resize(10001, r.points[0]); }), Error::InvalidGoal,
                "10001 points", "at most 10000");
  expectRefused(goal([](Request r) {
                  for (auto& point : r.points) point.velocities.assign(7, 0.0);
                  r.points[2].velocities[0] = 0.2;
                }),
                Error::InvalidGoal, "last point");
  expectRefused(goal([](Request r) { r.age = 5.0; }), Error::OldHeaderTimestamp, "5 s old");
  TrajectoryRequest later = through({home(0.0), home(0.3)});
  later.age = -61.0;
  EXPECT_EQ(controller->check(later).code, ReasonCode::GoalFromFuture);
  EXPECT_NE(controller->check(later).message.find(" 61 s"), std::string::npos);
  for (const double odd : {-0.5, -2.0, nan}) {
    expectRefused(goal([odd](Request r) { r.goal_time_tolerance = odd; }), Error::InvalidGoal,
                  "goal_time_tolerance is");
    expectRefused(goal([odd](Request r) {
                    r.goal_tolerance = {{"lwr_a1", odd, 0.0, 0.0}};
                  }),
                  Error::InvalidGoal, "goal_tolerance of lwr_a1");
    expectRefused(goal([odd](Request r) {
                    r.goal_tolerance = {{"lwr_a1", 0.0, 0.0, odd}};
                  }),
                  Error::InvalidGoal, "goal_tolerance of lwr_a1");
  }
  expectRefused(goal([nan](Request r) {
                  r.path_tolerance = {{"lwr_a1", nan, 0.0, 0.0}};
                }),
                Error::InvalidGoal, "path_tolerance");
  JointVector low = JointVector::Zero();  // stretched out, the hand below the floor
  low[1] = 2.0;
  TrajectoryRequest down = through({kHome, low});
  down.points[1].time = 6.0;
  expectRefused(down, Error::InvalidGoal, "leaves the workspace");
}

}  // namespace
}  // namespace coglab_controllers
