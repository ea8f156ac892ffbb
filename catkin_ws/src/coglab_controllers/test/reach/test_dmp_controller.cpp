// The DMP plug-in in virtual time: D4.10 Table 4.
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

TEST(DmpController, ReachesTheGoalFrameAndRestsExactlyStill) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  double t = 0.0;
  for (; t < 5.0 && robot.state() != MotionState::Reached; t += robot.period) {
    robot.see("human_hand", kGoal);
    robot.tick();
    for (int joint = 0; joint < kMaxJoints; ++joint) {
      ASSERT_LE(std::abs(robot.command.velocity[joint]), robot.limits.velocity[joint] + 1e-12);
    }
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  for (int i = 0; i < 200; ++i) {
    robot.see("human_hand", kGoal);
    robot.tick();
  }
  EXPECT_LT((robot.hand().position - kGoal).norm(), 1e-3);
  EXPECT_EQ(robot.command.velocity, JointVector::Zero().eval());
}

/// A hand that a person holds for a while during a motion does not leap when it is released.
TEST(DmpController, AHandThatWasHeldComesBackGently) {
  double chase[2];
  for (const bool shipped : {false, true}) {
    VirtualRobot robot(shipped ? "" : "dmp: {correction_speed: 10}");
    robot.followWithinLimits();
    robot.loadBoth();
    robot.see("human_hand", kGoal);
    robot.dmp().setIkDebug(true);
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    chase[shipped] = 0.0;
    for (int i = 0; i < 1600 && robot.state() != MotionState::Reached; ++i) {
      robot.see("human_hand", kGoal);
      const JointVector before = robot.sample.position;
      robot.tick();
      IkDebugRecord record;
      while (robot.dmp().readIkDebug(record)) {
      }
      if (i >= 80 && i < 140) {
        robot.sample.position = robot.sample.commanded_position = before;
        robot.sample.velocity.setZero();
        robot.sample.commanded_velocity.setZero();
        robot.sample.commanded_acceleration.setZero();
        robot.interpolator->reset(before);
      } else if (i >= 140) {
        chase[shipped] = std::max(chase[shipped], (robot.handVelocity() - record.velocity).norm());
      }
    }
    EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  }
  EXPECT_LT(chase[1], 0.9 * chase[0]);  // beside the way that the arm itself lags by
}

TEST(DmpController, OffsetIsAppliedOnceAndTurnsWithTheGoalFrame) {
  VirtualRobot robot;
  robot.loadBoth();
  const Quaternion turned(Eigen::AngleAxisd(M_PI / 2, Vector3::UnitZ()));
  DmpRequest request = robot.reach();
  request.goal_offset = Vector3(0.05, 0.0, 0.02);
  request.orientation_control = true;
  const Quaternion wanted = turned.conjugate() * robot.hand().orientation;
  request.target_orientation = wanted.coeffs();
  robot.see("human_hand", kGoal, turned);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  for (int i = 0; i < 800; ++i) {
    robot.see("human_hand", kGoal, turned);
    robot.tick();
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - (kGoal + Vector3(0.0, 0.05, 0.02))).norm(), 2e-3);
  EXPECT_LT(robot.hand().orientation.angularDistance(turned * wanted), 0.01);
}

TEST(DmpController, SwitchKeepsPhasePositionAndVelocityOfTheSetPointExactly) {
  // The clock of the motion is stopped for the switch, so that the state behind the references can
  // be compared before and after without a step of the integration between.
  for (const double ratio : {0.4, 1.0, 2.5}) {
    VirtualRobot robot("dmp: {enable_ik_debug: true}");
    robot.loadBoth();
    robot.see("human_hand", kGoal);
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    const auto tick = [&robot](int cycles) {
      for (int i = 0; i < cycles; ++i) {
        robot.see("human_hand", kGoal);
        robot.tick();
      }
    };
    tick(60);
    ASSERT_TRUE(robot.manager->setSpeedScale(0.0).success);
    tick(100);
    ASSERT_EQ(robot.manager->report().time_scale, 0.0);
    const DmpState before = robot.dmp().motion().dmp().state();
    ASSERT_GT(before.velocity.norm(), 0.05);
    DmpRequest request = robot.reach("give_human");
    request.dmp_ratio = ratio;
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().switchDmp(request)));
    tick(1);
    const Dmp& dmp = robot.dmp().motion().dmp();
    EXPECT_NEAR(dmp.ratio(), ratio, 1e-12);  // it is in effect
    EXPECT_EQ(dmp.state().phase, before.phase);
    EXPECT_LT((dmp.state().position - before.position).norm(), 1e-9);
    EXPECT_LT((dmp.state().velocity - before.velocity).norm(), 1e-9);
    // With the clock running, each set-point follows from the previous one and its velocity.
    IkDebugRecord record, last;
    while (robot.dmp().readIkDebug(record)) {
    }
    ASSERT_TRUE(robot.manager->setSpeedScale(1.0).success);
    tick(50);
    request.primitive_id = "reach_human";
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().switchDmp(request)));
    tick(50);
    int records = 0;
    for (; robot.dmp().readIkDebug(record); last = record) {
      if (records++ == 0) continue;
      const double passed = 1e-9 * static_cast<double>(record.stamp_ns - last.stamp_ns);
      const Vector3 led_to = last.set_point.position + passed * last.velocity;
      ASSERT_LT((led_to - record.set_point.position).norm(), 1e-9);
    }
    EXPECT_EQ(records, 100);
  }
}

TEST(DmpController, SecondExecuteDoesNotStepInVelocity) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  double worst = 0.0, worst_at_request = 0.0;
  for (int i = 0; i < 300; ++i) {
    robot.see("human_hand", kGoal);
    const JointVector before = robot.command.velocity;
    if (i == 80) {
      ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    }
    robot.tick();
    const double step = (robot.command.velocity - before).norm();
    if (i == 80) {
      worst_at_request = step;
    } else if (i > 2) {
      worst = std::max(worst, step);
    }
  }
  EXPECT_LT(worst_at_request, 3.0 * worst + 1e-3);
}

TEST(DmpController, SpeedScaleSlowsTheWholeMotion) {
  VirtualRobot slow, fast;
  slow.loadBoth();
  fast.loadBoth();
  ASSERT_TRUE(slow.manager->setSpeedScale(0.5).success);
  EXPECT_TRUE(refused(slow.manager->setSpeedScale(1.5), {"0", "1"}));
  const auto run = [](VirtualRobot& robot) {
    for (int i = 0; i < 200; ++i) robot.tick();  // the scale settles
    robot.see("human_hand", kGoal);
    EXPECT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    int cycles = 0;
    for (; cycles < 3000 && robot.state() != MotionState::Reached; ++cycles) {
      robot.see("human_hand", kGoal);
      robot.tick();
    }
    return cycles;
  };
  const int quick = run(fast);
  EXPECT_NEAR(run(slow), 2 * quick, 0.15 * quick);
}

TEST(DmpController, RobotThatStopsAbortsTheMotionAndRefusesNewOnes) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 40; ++i) robot.tick();
  robot.sample.block = coglab_rt::MotionBlock::Held;
  ++robot.sample.motion_epoch;
  robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Aborted);
  robot.see("human_hand", kGoal);
  EXPECT_TRUE(refused(robot.dmp().execute(robot.reach()), {"reset"}));
  robot.sample.block = coglab_rt::MotionBlock::None;
  for (int i = 0; i < 10; ++i) {
    robot.tick();
    EXPECT_EQ(robot.command.velocity, JointVector::Zero().eval());
  }
  EXPECT_EQ(robot.state(), MotionState::Aborted);  // nothing goes on by itself
  robot.see("human_hand", kGoal);
  EXPECT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
}

TEST(DmpController, AfterTheEndTheRemainingDistanceIsThatToTheGoalThatWasLatched) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  DmpProgress progress;
  double least = 1.0;
  for (int i = 0; i < 1000 && robot.state() != MotionState::Reached; ++i) {
    robot.see("human_hand", kGoal);
    robot.tick();
    ASSERT_TRUE(robot.dmp().readProgress(progress));
    least = std::min(least, progress.remaining_distance);
    if (progress.state == MotionState::Running && i > 5) {
      ASSERT_NEAR(progress.remaining_distance, (kGoal - robot.hand().position).norm(), 0.01) << i;
    }
  }
  ASSERT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  for (int i = 0; i < 200; ++i) {  // sights that differ by less than what is followed again
    robot.see("human_hand", kGoal + Vector3(0.0, i % 2 == 0 ? 0.02 : -0.02, 0.0));
    robot.tick();
    ASSERT_TRUE(robot.dmp().readProgress(progress));
    ASSERT_EQ(robot.state(), MotionState::Reached);
    ASSERT_LT(progress.remaining_distance, 0.005) << i;
  }
  EXPECT_NEAR(progress.remaining_distance, (progress.goal.position - robot.hand().position).norm(),
              1e-3);
  // If the standing hand is pushed away, the reported distance is that of the push: the first
  // joint, whose axis is vertical through the base, turned, moves it along a chord.
  constexpr double kTurn = 0.1;
  const double chord = 2.0 * kGoal.head<2>().norm() * std::sin(kTurn / 2.0);
  robot.sample.position[0] += kTurn;
  robot.tick();
  ASSERT_TRUE(robot.dmp().readProgress(progress));
  EXPECT_EQ(progress.state, MotionState::Reached);
  EXPECT_NEAR(progress.remaining_distance, chord, 2e-3);
}

class Rate : public ::testing::TestWithParam<double> {};

TEST_P(Rate, ReachesAtAnyRate) {
  VirtualRobot robot("{cycle_time: " + std::to_string(GetParam()) + "}", GetParam());
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  double t = 0.0;
  for (; t < 5.0 && robot.state() != MotionState::Reached; t += robot.period) {
    robot.see("human_hand", kGoal);
    robot.tick();
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT(t, 3.0);
  EXPECT_LT((robot.hand().position - kGoal).norm(), 3e-3);
}

INSTANTIATE_TEST_SUITE_P(DmpController, Rate, ::testing::Values(0.001, 0.002, 0.01, 0.02));

}  // namespace
}  // namespace coglab_controllers
