// Requests for motions and to the manager at the ends of their ranges, and the messages for people.
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::vector<double> posture(int joint = 0, double angle = kHome[0]) {
  std::vector<double> there(kHome.data(), kHome.data() + 7);
  there[static_cast<std::size_t>(joint)] = angle;
  return there;
}

struct Requests : ::testing::Test {
  Requests() { robot.loadBoth(); }
  /// Message of predict_dmp, which has the checks of execute_dmp and starts no motion.
  template <typename Change>
  Answer ask(Change&& change) {
    robot.see("human_hand", kGoal);
    DmpRequest request = robot.reach();
    change(request);
    PredictedPath path;
    return robot.dmp().predict(request, path);
  }
  VirtualRobot robot;
};

TEST_F(Requests, OfAReachHaveTheirRanges) {
  using R = DmpRequest;
  for (const double fine : {0.0, 0.02, 0.45}) {
    EXPECT_TRUE(VirtualRobot::ok(ask([&](R& r) { r.arrival_speed = fine; })));
  }
  for (const double bad : {0.0199, 0.4501, -0.02, 1e-9}) {
    EXPECT_EQ(ask([&](R& r) { r.arrival_speed = bad; }).code, ReasonCode::InvalidArgument) << bad;
  }
  for (const double fine : {0.05, 1.0, 100.0}) {
    EXPECT_TRUE(VirtualRobot::ok(ask([&](R& r) { r.dmp_ratio = fine; })));
  }
  for (const double bad : {0.0499, 100.1}) {
    EXPECT_EQ(ask([&](R& r) { r.dmp_ratio = bad; }).code, ReasonCode::OutOfRange) << bad;
  }
  EXPECT_TRUE(VirtualRobot::ok(ask([](R& r) { r.goal_approach = Vector3(0.18, 0.24, 0); })));
  for (const Vector3& bad : {Vector3(0.1801, 0.24, 0), Vector3(0, 0, std::nan(""))}) {
    EXPECT_EQ(ask([&](R& r) { r.goal_approach = bad; }).code, ReasonCode::InvalidArgument);
  }
  EXPECT_EQ(ask([](R& r) { r.primitive_id = "wave"; }).code, ReasonCode::UnknownName);
  EXPECT_EQ(ask([](R& r) { r.goal_offset.z() = INFINITY; }).code, ReasonCode::InvalidArgument);
  for (const int bad : {-1, 2}) {
    EXPECT_EQ(ask([&](R& r) { r.initial_state = bad; }).code, ReasonCode::InvalidArgument) << bad;
  }
}

TEST_F(Requests, OfAnOrientationAreUnitOrNothing) {
  const auto with = [this](const Eigen::Vector4d& q, bool control = true) {
    return ask([&](DmpRequest& r) {
             r.orientation_control = control;
             r.target_orientation = q;
           })
        .code;
  };
  EXPECT_EQ(with(Eigen::Vector4d::Zero()), ReasonCode::None);
  EXPECT_EQ(with({0, 0, 0, 1.0009}), ReasonCode::None);
  EXPECT_EQ(with({0, 0, 0, 1.0011}), ReasonCode::InvalidArgument);
  EXPECT_EQ(with({0, 0, 1e-9, 0}), ReasonCode::InvalidArgument);
  EXPECT_EQ(with({0, 0, std::nan(""), 1}), ReasonCode::InvalidArgument);
  EXPECT_EQ(with({0, 0, 7, 7}, false), ReasonCode::None) << "without control it does not matter";
}

TEST_F(Requests, OfAGivenStartAreNearTheHandAndNotTooFast) {
  const Vector3 hand = robot.hand().position;
  const auto from = [&](const Vector3& away, const Vector3& velocity) {
    return ask([&](DmpRequest& r) {
      r.initial_state = DmpRequest::kGiven;
      r.initial_position = hand + away;
      r.initial_velocity = velocity;
    });
  };
  const Vector3 still = Vector3::Zero();
  EXPECT_TRUE(VirtualRobot::ok(from(Vector3(0.0, 0.0999, 0.0), Vector3(0.0, 1.2, 1.599))));
  const Answer far = from(Vector3(0.0, 0.0, 0.1001), still);
  EXPECT_EQ(far.code, ReasonCode::OutOfRange);
  const Answer fast = from(still, Vector3(0.0, 1.2, 1.601));
  EXPECT_EQ(fast.code, ReasonCode::OutOfRange);
  EXPECT_EQ(from(Vector3(std::nan(""), 0, 0), still).code, ReasonCode::InvalidArgument);
  EXPECT_EQ(from(still, Vector3(0, INFINITY, 0)).code, ReasonCode::InvalidArgument);
}

TEST_F(Requests, OnlyAFrameMayHaveItsGoalInTheMarginOfTheWorkspace) {
  const auto at = [this](const Vector3& goal) {
    robot.see("human_hand", goal);
    PredictedPath path;
    return robot.dmp().predict(robot.reach(), path).code;
  };
  EXPECT_EQ(at(Vector3(1.699, 0.0, 0.5)), ReasonCode::None);
  EXPECT_EQ(at(Vector3(1.701, 0.0, 0.5)), ReasonCode::GoalOutsideWorkspace);
  EXPECT_EQ(at(Vector3(0.5, 0.0, -0.501)), ReasonCode::GoalOutsideWorkspace);
  DmpRequest request = robot.reach();
  request.goal_frame.clear();
  PredictedPath path;
  for (const auto& [x, code] :
       {std::pair(1.2, ReasonCode::None), {1.200001, ReasonCode::GoalOutsideWorkspace}}) {
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().setGoal("lwr_base_link", Vector3(x, 0, 0.5), 0)));
    EXPECT_EQ(robot.dmp().predict(request, path).code, code) << x;
    robot.tick();
  }
}

TEST_F(Requests, OfASwitchNeedAMotionThatHasBegun) {
  robot.see("human_hand", kGoal);
  EXPECT_EQ(robot.dmp().switchDmp(robot.reach()).code, ReasonCode::NothingRuns);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  EXPECT_EQ(robot.dmp().switchDmp(robot.reach()).code, ReasonCode::Busy) << "no joint state yet";
  robot.tick();
  EXPECT_TRUE(VirtualRobot::ok(robot.dmp().switchDmp(robot.reach("give_human"))));
  PredictedPath path;
  EXPECT_FALSE(robot.dmp().readPath(path)) << "nobody asked";
}

TEST_F(Requests, OfAnApproachComeAlongItInTheFrameThatTurns) {
  const Quaternion turned(Eigen::AngleAxisd(M_PI / 2, Vector3::UnitZ()));
  DmpRequest request = robot.reach();
  request.goal_offset = Vector3(0.02, 0.0, 0.0);
  request.goal_approach = Vector3(0.1, 0.0, 0.0);
  robot.see("human_hand", kGoal, turned);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  const auto tick = [&](int cycles) {
    for (int i = 0; i < cycles; ++i) {
      robot.see("human_hand", kGoal, turned);
      robot.tick();
    }
  };
  tick(20);
  EXPECT_LT((robot.dmp().motion().goal() - (kGoal + Vector3(0.0, -0.08, 0.0))).norm(), 1e-6);
  DmpRequest other = robot.reach("give_human");  // has no approach: the motion keeps its own
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().switchDmp(other)));
  tick(60);
  EXPECT_LT((robot.dmp().motion().goal() - (kGoal + Vector3(0.0, -0.1, 0.0))).norm(), 1e-2);
  tick(600);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
  EXPECT_LT((robot.hand().position - kGoal).norm(), 2e-3) << "the offset is that of the switch";
}

TEST_F(Requests, OfAPointToPointMotionAreTakenUpToTheLimits) {
  robot.switchTo("ptp");
  const auto code = [this](const PtpRequest& request) {
    const MotionAnswer answer = robot.ptp().add(request);
    robot.manager->askCancel("ptp", "");
    robot.tick();
    robot.tick();
    return answer.code;
  };
  const double kept = robot.limits.position_margin + 0.002;
  for (const int joint : {4, 6}) {
    const double upper = robot.limits.upper_position[joint] - kept;
    const double lower = robot.limits.lower_position[joint] + kept;
    for (const double fine : {upper - 1e-6, lower + 1e-6}) {
      EXPECT_EQ(code({posture(joint, fine), {}, {}}), ReasonCode::None) << fine;
    }
    for (const double bad : {upper + 1e-6, lower - 1e-6}) {
      EXPECT_EQ(code({posture(joint, bad), {}, {}}), ReasonCode::OutOfRange) << bad;
    }
    const auto joints = [joint](const JointVector& limit, double value) {
      std::vector<double> values(limit.data(), limit.data() + 7);
      values[static_cast<std::size_t>(joint)] = value;
      return values;
    };
    const JointVector &speed = robot.limits.velocity, &acceleration = robot.limits.acceleration;
    EXPECT_EQ(code({posture(), joints(speed, speed[joint]), joints(acceleration, 1e-4)}),
              ReasonCode::None);
    EXPECT_EQ(code({posture(), joints(speed, 1e-4), joints(acceleration, acceleration[joint])}),
              ReasonCode::None);
    for (const double bad : {0.99e-4, speed[joint] + 1e-6}) {
      EXPECT_EQ(code({posture(), joints(speed, bad), {}}), ReasonCode::OutOfRange) << bad;
    }
    for (const double bad : {0.99e-4, acceleration[joint] + 1e-6}) {
      EXPECT_EQ(code({posture(), {}, joints(acceleration, bad)}), ReasonCode::OutOfRange) << bad;
    }
    EXPECT_EQ(code({posture(joint, std::nan("")), {}, {}}), ReasonCode::InvalidArgument);
  }
  EXPECT_EQ(code({std::vector<double>(6, 0.0), {}, {}}), ReasonCode::InvalidArgument);
  EXPECT_EQ(code({std::vector<double>(8, 0.0), {}, {}}), ReasonCode::InvalidArgument);
}

TEST_F(Requests, AreWelcomeByTheNewestJointState) {
  const ControllerManager& manager = *robot.manager;
  CycleReport now = manager.report();
  const auto code = [&](const CycleReport& report) {
    return manager.motionWelcome("dmp", report).code;
  };
  EXPECT_EQ(code(now), ReasonCode::None);
  now.robot.stamp_ns = robot.now_ns - 100 * kMs;
  EXPECT_EQ(code(now), ReasonCode::None);
  now.robot.stamp_ns = robot.now_ns - 101 * kMs;
  EXPECT_EQ(code(now), ReasonCode::StaleJointState);
  now = manager.report();
  now.robot.block = MotionBlock::DriveError;
  EXPECT_EQ(code(now), ReasonCode::DriveError);
  now.samples = 0;
  EXPECT_EQ(code(now), ReasonCode::StaleJointState);
  now.fault = true;
  now.reason = Reason(ReasonCode::ControllerFault, "it broke");
  EXPECT_EQ(code(now), ReasonCode::ControllerFault);
  EXPECT_EQ(manager.motionWelcome("ptp", now).code, ReasonCode::NotActive);
}

TEST(RequestsWithoutACycle, AreWithdrawnAndLeaveNothing) {
  VirtualRobot robot("", 0.005, false);
  std::atomic<bool> stop{false};
  std::thread control([&] {
    while (!stop) {
      robot.tick();
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  });
  robot.loadBoth("ptp");
  stop = true;
  control.join();
  const MotionAnswer lost = robot.ptp().add({posture(0, -1.2), {}, {}});
  EXPECT_EQ(lost.status, MotionAnswer::kRejected);
  EXPECT_EQ(lost.code, ReasonCode::NotAdopted);
  EXPECT_EQ(lost.id, -1);
  EXPECT_TRUE(refused(lost, {"2.0", "does not run", "withdrawn"}));
  ctrl_more::FeedbackControllersManager& feedback = robot.manager->feedback();
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->load("limits", "JointLimits")));
  ASSERT_TRUE(feedback.setProfile("dmp", {"limits"}).ok());
  ASSERT_TRUE(feedback.setProfile("ptp", {}).ok());
  std::string type, id;
  EXPECT_EQ(robot.manager->switchTo("dmp", type).code, ReasonCode::NotAdopted);
  robot.manager->active(id, type);
  EXPECT_EQ(id, "ptp");
  for (int i = 0; i < 5; ++i) robot.tick();
  EXPECT_TRUE(robot.sample.position == kHome) << "the motion was withdrawn";
  EXPECT_EQ(robot.manager->report().active.str(), "ptp");
  EXPECT_EQ(robot.manager->profile(), "");
  // A cancel is waited for as long as it says, by default for two seconds.
  EXPECT_TRUE(refused(robot.manager->cancel("ptp", 0.05, ""), {" 0.", "runs again"}));
  const CancelAnswer unheard = robot.manager->cancel("ptp", 0.0, "");
  EXPECT_EQ(unheard.code, ReasonCode::NotAdopted);
  EXPECT_TRUE(refused(unheard, {" 2."}));
  const Answer later = robot.manager->applyProfile("dmp");
  EXPECT_TRUE(VirtualRobot::ok(later));
}

}  // namespace
}  // namespace coglab_controllers
