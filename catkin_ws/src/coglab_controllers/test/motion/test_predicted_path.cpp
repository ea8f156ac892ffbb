// Predicted paths: a roll-out equals the executed motion, before it begins and while it runs, also
// at its end, at rest and after a switch.
#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const Vector3 kGoal(0.80, 0.0, 0.45);

/// Place on the path at a time, between its poses on a straight line.
Vector3 placeAt(const TimedPath& path, double t) {
  std::size_t i = 1;
  while (i + 1 < path.times.size() && path.times[i] < t) ++i;
  const double share = (t - path.times[i - 1]) / (path.times[i] - path.times[i - 1]);
  return path.poses[i - 1].position +
         std::min(share, 1.0) * (path.poses[i].position - path.poses[i - 1].position);
}

::testing::AssertionResult wellFormed(const TimedPath& path) {
  if (path.times.size() != path.poses.size() || path.times.size() < 2) {
    return ::testing::AssertionFailure() << path.times.size() << " times";
  }
  if (path.times.size() > kPathPoints + 1) return ::testing::AssertionFailure() << "too many";
  for (std::size_t i = 0; i < path.times.size(); ++i) {
    if (i > 0 && path.times[i] <= path.times[i - 1]) {
      return ::testing::AssertionFailure() << "time " << i << " does not grow";
    }
    if (std::abs(path.poses[i].orientation.norm() - 1.0) > 1e-9) {
      return ::testing::AssertionFailure() << "no unit quaternion";
    }
  }
  return ::testing::AssertionSuccess();
}

/// The path of the motion that runs now.
template <typename Controller>
PredictedPath pathNow(VirtualRobot& robot, Controller& controller) {
  controller.askPath();
  robot.tick();
  PredictedPath path;
  EXPECT_TRUE(controller.readPath(path));
  EXPECT_EQ(path.stamp_ns, robot.now_ns);
  EXPECT_TRUE(wellFormed(path.path));
  return path;
}

/// Ticks to the end of the motion; the largest distance from the hand to the path, m.
double drive(VirtualRobot& robot, const PredictedPath& path, const Vector3* goal = nullptr) {
  double worst = 0.0;
  for (int i = 0; i < 4000 && robot.state() == MotionState::Running; ++i) {
    if (goal != nullptr) robot.see("human_hand", *goal);
    const Vector3 hand = robot.hand().position;  // as measured at the next tick
    const double t = 1e-9 * static_cast<double>(robot.now_ns - path.stamp_ns) + robot.period;
    worst = std::max(worst, (placeAt(path.path, t) - hand).norm());
    robot.tick();
  }
  return worst;
}

TEST(RollOut, EqualsTheExecutedMotion) {
  Library library;
  library.load(std::string(PACKAGE_DIR) + "/config/primitives.xml");
  const double dt = 0.01;  // as the roll-out has it, so that both are the same numbers
  for (const double rate : {1.0, 0.5}) {
    CartesianMotion motion;
    const DmpPlan plan{Dmp(library.at("reach_human")), 1.3, true};
    Pose goal{kGoal, Quaternion(Eigen::AngleAxisd(0.4, Vector3::UnitZ()))};
    motion.start(plan, {Vector3(0.4, 0.1, 0.3), Quaternion::Identity()}, Vector3(0.0, 0.1, 0.0),
                 Vector3::Zero(), goal);
    for (int i = 0; i < 40; ++i) {
      goal.position.y() += 0.002;
      motion.step(dt / rate, goal, rate);
    }
    const TimedPath path = motion.rollOut(goal, motion.rate());
    ASSERT_TRUE(wellFormed(path));
    EXPECT_EQ(path.times.front(), 0.0);
    std::size_t at = 0;
    for (int i = 0; at < path.times.size(); ++i) {
      ASSERT_LT(i, 2000);
      const Pose pose = motion.step(dt / rate, goal, rate).pose;
      if (std::abs(path.times[at] - i * dt / rate) > 1e-6) continue;
      EXPECT_LT((path.poses[at].position - pose.position).norm(), 1e-12) << at;
      EXPECT_LT(path.poses[at].orientation.angularDistance(pose.orientation), 1e-9) << at;
      ++at;
    }
    EXPECT_LT((path.poses.back().position - goal.position).norm(), 2e-3);
  }
}

TEST(RollOut, OfAMotionThatIsNotBegunIsEmptyAndOneThatNeverArrivesEnds) {
  EXPECT_TRUE(CartesianMotion().rollOut({}).poses.empty());
  Library library;
  library.load(std::string(PACKAGE_DIR) + "/config/primitives.xml");
  MotionEndParameters never;
  never.distance = 1e-5;
  never.speed = 1e-6;
  CartesianMotion motion({}, never);
  motion.start({Dmp(library.at("reach_human")), 1.0, true}, {}, Vector3::Zero(), Vector3::Zero(),
               {kGoal, Quaternion::Identity()});
  const TimedPath path = motion.rollOut({kGoal, Quaternion::Identity()}, 0.0);
  EXPECT_TRUE(wellFormed(path));
  EXPECT_GT(path.times.back(), 1.0 / kSlowestClock);  // a clock that stands is taken to crawl
}

TEST(RollOut, OfALongMotionIsAsLongAndAsExact) {
  Library library;
  library.load(std::string(PACKAGE_DIR) + "/config/primitives.xml");
  const Pose start{Vector3(0.4, 0.1, 0.3), Quaternion::Identity()};
  const Pose goal{kGoal, Quaternion::Identity()};
  const auto path = [&](double ratio) {
    CartesianMotion motion;
    motion.start({Dmp(library.at("reach_human")), ratio, true}, start, Vector3::Zero(),
                 Vector3::Zero(), goal);
    return motion.rollOut(goal);
  };
  const TimedPath quick = path(1.0), slow = path(100.0);
  ASSERT_TRUE(wellFormed(slow));
  for (const double share : {0.2, 0.4, 0.6, 0.8}) {
    const double t = share * library.at("reach_human").duration;
    EXPECT_LT((placeAt(quick, t) - placeAt(slow, 100.0 * t)).norm(), 5e-3) << share;
  }
}

DmpPlan reachPlan(double ratio = 1.0) {
  Library library;
  library.load(std::string(PACKAGE_DIR) + "/config/primitives.xml");
  return {Dmp(library.at("reach_human")), ratio, true};
}

const Pose kStart{Vector3(0.4, 0.1, 0.3), Quaternion::Identity()};

TEST(CartesianMotion, KeepsItsAngularVelocityAtTheStartAndAtASwitch) {
  const Vector3 turning(0.2, -0.3, 0.4);
  const Pose goal{kGoal, Quaternion(Eigen::AngleAxisd(1.1, Vector3(0.6, 0.0, 0.8)))};
  for (const double rate : {1.0, 0.15}) {
    CartesianMotion motion;
    motion.start(reachPlan(2.0), kStart, Vector3::Zero(), turning, goal);
    EXPECT_LT((motion.step(0.005, goal).angular_velocity - turning).norm(), 3e-3);
    for (int i = 0; i < 120; ++i) motion.step(0.005, goal, i < 100 ? 1.0 : rate);
    const Vector3 before = motion.reference().angular_velocity;
    ASSERT_GT(before.norm(), 0.02);
    motion.switchTo(reachPlan(1.5), goal);
    EXPECT_LT((motion.step(0.005, goal, rate).angular_velocity - before).norm(),
              0.02 * before.norm());
  }
}

TEST(PredictedPath, BeforeAReachEqualsThePathOfTheReachAndStartsNoMotion) {
  VirtualRobot robot;
  robot.loadBoth("ptp");  // the controller need not be the active one
  DmpRequest request = robot.reach();
  request.goal_offset = Vector3(-0.05, 0.0, 0.02);
  robot.see("human_hand", kGoal);
  PredictedPath ahead;
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().predict(request, ahead)));
  ASSERT_TRUE(wellFormed(ahead.path));
  EXPECT_EQ(ahead.motion, "reach_human");
  EXPECT_LT((ahead.path.poses.front().position - robot.hand().position).norm(), 1e-9);
  EXPECT_LT((ahead.path.poses.back().position - (kGoal + request.goal_offset)).norm(), 2e-3);
  const JointVector before = robot.sample.position;
  for (int i = 0; i < 50; ++i) robot.tick();
  EXPECT_EQ(robot.sample.position, before);
  robot.switchTo("dmp");
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  ahead.stamp_ns = robot.now_ns + static_cast<std::int64_t>(robot.period * 1e9);
  robot.tick();
  EXPECT_LT(drive(robot, ahead, &kGoal), 5e-3);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
}

TEST(PredictedPath, OfAReachUnderWayFollowsItsGoalAndItsClock) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  Vector3 goal = kGoal;
  for (int i = 0; i < 60; ++i) {
    goal.y() += 0.0005;
    robot.see("human_hand", goal);
    robot.tick();
  }
  PredictedPath path = pathNow(robot, robot.dmp());
  EXPECT_EQ(path.motion, "reach_human");
  EXPECT_LT((path.path.poses.back().position - goal).norm(), 2e-3);
  const double full = path.path.times.back();
  ASSERT_TRUE(robot.manager->setSpeedScale(0.5).success);
  for (int i = 0; i < 40; ++i) {
    robot.see("human_hand", goal);
    robot.tick();
  }
  path = pathNow(robot, robot.dmp());
  EXPECT_GT(path.path.times.back(), 1.3 * full) << "half as fast";
  EXPECT_LT(drive(robot, path, &goal), 5e-3);
  EXPECT_EQ(robot.state(), MotionState::Reached) << robot.reason();
}

TEST(PredictedPath, OfAPointToPointMotionIsItsProfile) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const std::vector<double> there = {-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6};
  const MotionAnswer answer = robot.ptp().add({there, {}, {}});
  ASSERT_EQ(answer.status, MotionAnswer::kStarted) << answer.message;
  robot.tick();
  EXPECT_TRUE(robot.ptp().moving());
  for (int i = 0; i < 50; ++i) robot.tick();
  const PredictedPath path = pathNow(robot, robot.ptp());
  EXPECT_EQ(path.motion, "ptp " + std::to_string(answer.id));
  EXPECT_LT(drive(robot, path), 2e-3);
  EXPECT_EQ(robot.state(), MotionState::Reached);
  EXPECT_LT((path.path.poses.back().position - robot.hand().position).norm(), 1e-5);
  EXPECT_FALSE(robot.ptp().moving());
  PredictedPath none;
  robot.ptp().askPath();
  robot.tick();
  EXPECT_FALSE(robot.ptp().readPath(none)) << "no motion, no path";
}

}  // namespace
}  // namespace coglab_controllers
