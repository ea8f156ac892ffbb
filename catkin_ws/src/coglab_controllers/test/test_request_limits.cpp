// Requests of motions and of the manager at the ends of what they may ask, and the words of the
// answers that people read.
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const Vector3 kGoal(0.80, 0.0, 0.45);
constexpr std::int64_t kMs = 1'000'000;

std::vector<double> posture(int joint = 0, double angle = kHome[0]) {
  std::vector<double> there(kHome.data(), kHome.data() + 7);
  there[static_cast<std::size_t>(joint)] = angle;
  return there;
}

struct Requests : ::testing::Test {
  Requests() { robot.loadBoth(); }
  /// What predict_dmp says, which checks as execute_dmp does and begins nothing.
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
  EXPECT_EQ(R::kCurrent, 0);
  EXPECT_EQ(R::kGiven, 1);
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
  EXPECT_NE(far.message.find("allowed: 0.1"), std::string::npos) << far.message;
  const Answer fast = from(still, Vector3(0.0, 1.2, 1.601));
  EXPECT_EQ(fast.code, ReasonCode::OutOfRange);
  EXPECT_NE(fast.message.find("initial_velocity is 2.0"), std::string::npos) << fast.message;
  EXPECT_EQ(from(Vector3(std::nan(""), 0, 0), still).code, ReasonCode::InvalidArgument);
  EXPECT_EQ(from(still, Vector3(0, INFINITY, 0)).code, ReasonCode::InvalidArgument);
}

TEST_F(Requests, OfAFrameMayHaveItsGoalOutsideTheWorkspaceByAMarginAndOfTheTopicNot) {
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

TEST_F(Requests, OfAPointToPointMotionWithoutSpeedsTakeTheirSharesOfTheLimits) {
  robot.switchTo("ptp");
  ASSERT_EQ(robot.ptp().add({posture(0, 0.4), {}, {}}).status, MotionAnswer::kStarted);
  double fastest = 0.0, hardest = 0.0, before = 0.0;
  for (int i = 0; i < 2000 && (i < 3 || robot.state() == MotionState::Running); ++i) {
    robot.tick();
    const double now = robot.command.velocity[0];
    if (i > 5) hardest = std::max(hardest, std::abs(now - before) / 0.005);
    fastest = std::max(fastest, now);
    before = now;
  }
  EXPECT_NEAR(fastest, 0.3 * robot.limits.velocity[0], 1e-3);
  EXPECT_NEAR(hardest, 0.2 * robot.limits.acceleration[0], 0.02);
  EXPECT_FALSE(robot.ptp().moving());
  PredictedPath path;  // one to where the arm is has its end now
  ASSERT_EQ(robot.ptp().add({posture(0, 0.4), {}, {}}).status, MotionAnswer::kStarted);
  robot.ptp().askPath();
  robot.tick();
  if (robot.ptp().readPath(path)) {
    EXPECT_LE(path.path.times.size(), 41u);
  }
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
  const auto words = [&](const std::string& id) { return manager.motionWelcome(id, now).message; };
  EXPECT_EQ(words("dmp"), "the newest joint state is 0.101000 s old; allowed: 0.100000 s");
  now = manager.report();
  now.robot.block = MotionBlock::DriveError;
  EXPECT_EQ(code(now), ReasonCode::DriveError);
  EXPECT_EQ(words("dmp"), std::string("the robot follows no motion now: ") +
                              coglab_rt::describe(MotionBlock::DriveError) +
                              "; see lwr/state, then use lwr/command (reset, start)");
  now.samples = 0;
  EXPECT_EQ(code(now), ReasonCode::StaleJointState);
  EXPECT_EQ(words("dmp"), "no joint state from the robot yet; start the robot's interface first");
  now.fault = true;
  now.reason = Reason(ReasonCode::ControllerFault, "it broke");
  EXPECT_EQ(code(now), ReasonCode::ControllerFault);
  EXPECT_EQ(words("dmp"),
            "controller 'dmp' is at fault: it broke; call switch_controller with 'dmp' to start it "
            "afresh");
  EXPECT_EQ(manager.motionWelcome("ptp", now).code, ReasonCode::NotActive);
  EXPECT_EQ(words("ptp"),
            "controller 'ptp' is not active; active is 'dmp'; call switch_controller with 'ptp' "
            "first");
}

TEST_F(Requests, OfTheManagerHaveNamesOfLettersAndAScaleFromZeroToOne) {
  ControllerManager& manager = *robot.manager;
  const std::string type = "coglab/PtpController";
  for (const std::string& fine : {std::string(48, 'a'), std::string("Z9_")}) {
    EXPECT_TRUE(VirtualRobot::ok(manager.load(fine, type))) << fine;
  }
  for (const std::string& bad : {std::string(49, 'a'), std::string("_a"), std::string("9a"),
                                 std::string("a-b"), std::string("\xc3\xa4")}) {
    EXPECT_TRUE(refused(manager.load(bad, type), {"controller_id", "up to 48 letters"})) << bad;
  }
  ASSERT_TRUE(VirtualRobot::ok(manager.load("limits", "JointLimits")));
  EXPECT_TRUE(refused(manager.load("limits", type), {"in use"}));
  std::string active;
  EXPECT_TRUE(refused(manager.switchTo("limits", active), {"is a feedback controller"}));
  EXPECT_EQ(manager.switchTo("dmp", active).message, "'dmp' is active already");
  EXPECT_NE(manager.switchTo("ptp", active).message.find("no feedback profile of this name"),
            std::string::npos);
  EXPECT_EQ(active, type);
  EXPECT_TRUE(VirtualRobot::ok(manager.switchTo("", active)));
  EXPECT_EQ(manager.switchTo("", active).message, "no controller is active");
  EXPECT_EQ(manager.applyProfile("nobody").code, ReasonCode::UnknownName);
  EXPECT_EQ(manager.unload("nobody").code, ReasonCode::UnknownName);
  for (const double fine : {0.0, 1.0}) EXPECT_TRUE(manager.setSpeedScale(fine).success);
  for (const double bad : {-1e-9, 1.0 + 1e-9, std::nan(""), 1.0 / 0.0}) {
    EXPECT_EQ(manager.setSpeedScale(bad).code, ReasonCode::OutOfRange) << bad;
  }
  EXPECT_EQ(manager.report().speed_scale, 1.0);
}

TEST_F(Requests, OfACancelThatComesToNoEndSayWhy) {
  robot.switchTo("ptp");
  robot.followWithinLimits();
  ASSERT_EQ(robot.ptp().add({posture(0, 0.4), {}, {}}).status, MotionAnswer::kStarted);
  for (int i = 0; i < 80; ++i) robot.tick();
  const CancelOrder order = robot.manager->askCancel("ptp", std::string(150, 'x'));
  CancelAnswer answer = robot.manager->cancelUnfinished(order, 0.25);
  EXPECT_EQ(answer.code, ReasonCode::NotAdopted);
  EXPECT_FALSE(answer.was_running);
  EXPECT_NE(answer.message.find("within 0.250000 s"), std::string::npos) << answer.message;
  robot.tick();
  answer = robot.manager->cancelUnfinished(order, 0.25);
  EXPECT_EQ(answer.code, ReasonCode::TimeLimit);
  EXPECT_TRUE(answer.was_running);
  EXPECT_NE(answer.message.find("its largest joint speed is 0."), std::string::npos);
  const std::string reason = robot.reason();
  EXPECT_NE(reason.find("cancelled: " + std::string(120, 'x')), std::string::npos);
  EXPECT_EQ(reason.find(std::string(121, 'x')), std::string::npos) << reason;
  robot.manager->cycle().idle(robot.now_ns + 200 * kMs);
  answer = robot.manager->cancelUnfinished(order, 0.25);
  EXPECT_EQ(answer.code, ReasonCode::StaleJointState);
  EXPECT_NE(answer.message.find("did not come to rest within 0.250000 s: no joint state"),
            std::string::npos);
}

TEST_F(Requests, OfACancelNameTheControllerThatHoldsTheArmOnItsWay) {
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  for (int i = 0; i < 60; ++i) robot.tick();
  ASSERT_EQ(robot.state(), MotionState::Holding);
  const CancelOrder order = robot.manager->askCancel("ptp", "");
  robot.tick();
  robot.tick();
  CancelAnswer answer;
  answer.was_running = true;  // of one before
  EXPECT_TRUE(robot.manager->cancelEnded(order, answer));
  EXPECT_EQ(answer.code, ReasonCode::NotActive);
  EXPECT_FALSE(answer.was_running);
  EXPECT_EQ(answer.message,
            "no motion of 'ptp' was running; 'dmp' moves the arm: cancel its motion");
  answer.was_running = true;
  EXPECT_TRUE(robot.manager->cancelEnded(robot.manager->askCancel("nobody", ""), answer));
  EXPECT_EQ(answer.message, "controller_id 'nobody' is not loaded");
  EXPECT_FALSE(answer.was_running);
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
  EXPECT_TRUE(refused(lost, {"did not take the request within 0.3", "cycle does not run",
                             "withdrawn and has no effect"}));
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
  EXPECT_TRUE(refused(robot.manager->cancel("ptp", 0.05, ""),
                      {"not taken the cancel over within 0.", "as soon as it runs again"}));
  const CancelAnswer unheard = robot.manager->cancel("ptp", 0.0, "");
  EXPECT_EQ(unheard.code, ReasonCode::NotAdopted);
  EXPECT_TRUE(refused(unheard, {"not taken the cancel over within 2."}));
  const Answer later = robot.manager->applyProfile("dmp");
  EXPECT_TRUE(VirtualRobot::ok(later));
  EXPECT_EQ(later.message,
            "the control cycle has not taken the change yet; it will with its next cycle");
}

}  // namespace
}  // namespace coglab_controllers
