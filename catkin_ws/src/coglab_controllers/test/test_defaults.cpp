// What the types that requests, controllers and nodes fill hold before anybody has filled them.
#include <gtest/gtest.h>

#include "coglab_controllers/ideal/ideal_arm.hpp"
#include "coglab_controllers/motion/authored_controller.hpp"
#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_controllers/ros/manager_ros.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {
namespace {

TEST(Defaults, AReachIsThatOfD410WithoutOffsetsOrLimits) {
  const DmpRequest request;
  EXPECT_EQ(request.initial_state, DmpRequest::kCurrent);
  EXPECT_EQ(request.dmp_ratio, 1.0);
  EXPECT_EQ(request.arrival_speed, 0.0);
  EXPECT_FALSE(request.orientation_control);
  EXPECT_TRUE(request.target_orientation.isZero(0.0));
  EXPECT_TRUE(request.goal_offset.isZero(0.0) && request.goal_approach.isZero(0.0));
  const DmpPlan plan;
  EXPECT_TRUE(plan.execute);
  EXPECT_FALSE(plan.given);
  EXPECT_TRUE(plan.hand.in_goal_frame);
  EXPECT_TRUE(plan.hand.keep_orientation);
  EXPECT_EQ(plan.motion.ratio, 1.0);
  EXPECT_TRUE(plan.motion.orientation_control);
  EXPECT_EQ(plan.motion.arrival_speed, 0.0);
  EXPECT_FALSE(plan.motion.predicted);
  const DmpProgress progress;
  EXPECT_EQ(progress.stamp_ns, 0);
  EXPECT_EQ(progress.phase, 0.0);
  EXPECT_EQ(progress.remaining_distance, 0.0);
  EXPECT_EQ(progress.remaining_time, 0.0);
  EXPECT_EQ(progress.state, MotionState::Idle);
  EXPECT_EQ(IkDebugRecord().stamp_ns, 0);
  EXPECT_EQ(IkDebugRecord().phase, 0.0);
  EXPECT_EQ(DmpSnapshot().stamp_ns, 0);
}

TEST(Defaults, AGoalThatNobodySawIsStaticAndAtRest) {
  const GoalObservation goal;
  EXPECT_EQ(goal.stamp_ns, 0);
  EXPECT_EQ(goal.frame_ns, 0);
  EXPECT_EQ(goal.clock_steps, 0u);
  EXPECT_EQ(goal.request, 0u);
  const GoalGate gate;
  EXPECT_EQ(gate.state(), GoalGate::State::Unsettled);
  EXPECT_EQ(gate.jump(), 0.0);
  EXPECT_EQ(gate.age(), 0.0);
  EXPECT_EQ(GoalFeed().ahead(), 0.0);
  const CartesianMotion motion;
  EXPECT_EQ(motion.phase(), CartesianMotion::Phase::Idle);
  EXPECT_EQ(motion.rate(), 1.0);
  EXPECT_EQ(motion.remainingDistance(), 0.0);
  EXPECT_EQ(motion.remainingTime(), 0.0);
}

TEST(Defaults, MotionsAreNumberedFromZeroAndNoneHasMinusOne) {
  EXPECT_EQ(MotionAnswer::kStarted, 0);
  EXPECT_EQ(MotionAnswer::kQueued, 1);
  EXPECT_EQ(MotionAnswer::kRejected, 2);
  EXPECT_EQ(MotionAnswer().status, 2);
  EXPECT_EQ(MotionAnswer().id, -1);
  const MotionProgress progress;
  EXPECT_EQ(progress.id, -1);
  EXPECT_EQ(progress.stamp_ns, 0);
  EXPECT_EQ(progress.time, 0.0);
  EXPECT_EQ(progress.queued, 0);
  EXPECT_FALSE(MotionRequestByName().queue);
  const PtpSnapshot snapshot;
  EXPECT_EQ(snapshot.id, -1);
  EXPECT_EQ(snapshot.stamp_ns, 0);
  EXPECT_EQ(snapshot.time, 0.0);
  EXPECT_EQ(snapshot.rate, 1.0);
  EXPECT_EQ(PredictedPath().stamp_ns, 0);
  EXPECT_TRUE(PredictedPath().path.times.empty());
  const MotionArgument argument;
  EXPECT_EQ(argument.fallback, 0.0);
  EXPECT_EQ(argument.least, 0.0);
  EXPECT_EQ(argument.most, 0.0);
  EXPECT_EQ(ArgumentIndex().value, 0u);
  EXPECT_EQ(MotionArguments::kMost, 16u);
  EXPECT_EQ(MotionArguments()[ArgumentIndex{3}], 0.0);
}

TEST(Defaults, ACycleThatHasNotRunTellsNothing) {
  const CycleReport report;
  for (const std::uint64_t count : {report.cycles, report.samples, report.generation,
                                    report.overruns, report.faults, report.stale}) {
    EXPECT_EQ(count, 0u);
  }
  for (const double time : {report.dt, report.duration, report.longest}) EXPECT_EQ(time, 0.0);
  EXPECT_EQ(report.time_scale, 1.0);
  EXPECT_EQ(report.speed_scale, 1.0);
  EXPECT_FALSE(report.fault);
  EXPECT_FALSE(report.standing);
  EXPECT_EQ(report.state, ManagerState::Idle);
  EXPECT_EQ(report.motion, MotionState::Idle);
  const CycleInput input;
  EXPECT_EQ(input.dt, 0.0);
  EXPECT_EQ(input.time_scale, 1.0);
  EXPECT_EQ(input.cancels, 0u);
  EXPECT_FALSE(input.motion_allowed);
  EXPECT_EQ(MotionSetup().cycle_time, 0.005);
  EXPECT_EQ(MotionSetup().host, nullptr);
  const CycleSettings settings;
  EXPECT_EQ(settings.cycle_time, 0.005);
  EXPECT_EQ(settings.sample_timeout, 0.1);
  EXPECT_EQ(settings.silent_time, 0.5);
  EXPECT_EQ(settings.overrun_time, 0.004);
  EXPECT_EQ(settings.blocked_time, 0.5);
  EXPECT_EQ(settings.overruns_to_fault, 5);
  EXPECT_EQ(CancelOrder().number, 0u);
  EXPECT_EQ(CancelOrder().cycles, 0u);
  EXPECT_FALSE(CancelAnswer().was_running);
}

TEST(Defaults, TheControlThreadIsBelowTheArmsAndIdlesEveryTwentyMilliseconds) {
  const ControlThreadOptions thread;
  EXPECT_EQ(thread.priority, 70);
  EXPECT_EQ(thread.idle_period, 0.02);
  EXPECT_EQ(thread.stack_bytes, 1024u * 1024u);
  const ManagerRos::Options options;
  EXPECT_TRUE(options.publish_target);
  EXPECT_EQ(options.highest_priority, 99);
  EXPECT_EQ(IdealArmView().state, IdealArmState::Monitor);
  EXPECT_FALSE(IdealArmView().hold_latched);
  EXPECT_EQ(kPathPoints, 40);
  EXPECT_EQ(kSlowestClock, 0.1);
}

/// A row of a store as `key: size, unit, frame`.
std::vector<std::string> rows(const std::vector<ctrl_more::SignalInfo>& signals) {
  std::vector<std::string> texts;
  for (const ctrl_more::SignalInfo& row : signals) {
    texts.push_back(row.key + ": " + std::to_string(row.size) + ", " + row.unit + ", " + row.frame);
  }
  return texts;
}

TEST(Defaults, WhatControllersShareHasItsUnitsAndFramesAndBeginsAtTheBase) {
  using ctrl_more::ControlContainer;
  using ctrl_more::RobotSource;
  using Rows = std::vector<std::string>;
  const std::string description = DESCRIPTION_DIR, wire = ", joints in wire order";
  const auto robot =
      makeRobotSetup(readText(description + "/urdf/lwr_ih2.urdf"),
                     coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml"),
                     Parameters(YAML::Load("{tactile: true}"), "controller_manager"));
  ctrl_more::Logger logger;
  FeedbackStage stage(*robot, 0.004, true, &logger), timed(*robot, 0.004, false, &logger);
  EXPECT_EQ(rows(stage.robot().signals(RobotSource::Measured)),
            (Rows{"joint_position: 7, rad" + wire, "joint_velocity: 7, rad/s" + wire,
                  "joint_torque: 7, Nm" + wire, "external_torque: 7, Nm" + wire,
                  "wrench: 6, N, Nm, base", "touch: 18, N, tool"}));
  EXPECT_EQ(rows(stage.robot().signals(RobotSource::Estimated)),
            (Rows{"ee: 7, m, quaternion x y z w, base"}));
  References& references = stage.references();
  ctrl_more::ControlStates& states = references.states;
  EXPECT_EQ(rows(states.signals(ControlContainer::TaskSpaceReferencePose)),
            (Rows{"ee: 7, m, quaternion x y z w, base"}));
  EXPECT_EQ(rows(states.signals(ControlContainer::TaskSpaceReferenceVel)),
            (Rows{"ee: 6, m/s, rad/s, base"}));
  EXPECT_EQ(rows(states.signals(ControlContainer::JointSpaceReference)),
            (Rows{"Position: 7, rad" + wire, "Velocity: 7, rad/s" + wire}));
  Eigen::Matrix<double, 7, 1> base;
  base << 0, 0, 0, 0, 0, 0, 1;
  EXPECT_TRUE(states.view(references.pose) == base);
  EXPECT_TRUE(states.view(references.twist).isZero(0.0));
  EXPECT_TRUE(states.view(references.joint_velocity).isZero(0.0));
  EXPECT_EQ(states.joints(), 7);
  EXPECT_EQ(states.controlPeriod(), 0.004);
  EXPECT_TRUE(stage.manager().options().lockstep && !stage.manager().options().timed);
  EXPECT_TRUE(timed.manager().options().timed && !timed.manager().options().lockstep);
}

}  // namespace
}  // namespace coglab_controllers
