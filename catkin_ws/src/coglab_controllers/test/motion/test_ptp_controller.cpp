// The point-to-point plug-in in virtual time: D4.10 Table 5.
#include <array>
#include <atomic>
#include <chrono>
#include <random>
#include <sstream>
#include <thread>

#include "coglab_controllers/limits/workspace.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const std::vector<double> kThere = {-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6};

std::vector<int> executed(PtpController& ptp) {
  std::vector<int> ids;
  EndedMotion end;
  while (ptp.readEnd(end)) {
    if (end.executed) ids.push_back(end.id);
  }
  return ids;
}

TEST(PtpController, EndsExactlyWithinItsLimitsAndReportsOnce) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const std::vector<double> speed(7, 0.5), acceleration(7, 1.0);
  const MotionAnswer answer = robot.ptp().add({kThere, speed, acceleration});
  ASSERT_EQ(answer.status, MotionAnswer::kStarted) << answer.message;
  const JointVector start = robot.sample.position;
  const JointVector target = Eigen::Map<const JointVector>(kThere.data());
  JointVector before = JointVector::Zero();
  for (int i = 0; i < 2000; ++i) {
    robot.tick();
    for (int joint = 0; joint < kMaxJoints; ++joint) {
      ASSERT_LE(std::abs(robot.command.velocity[joint]), 0.5 + 1e-6);
      ASSERT_LE(std::abs(robot.command.velocity[joint] - before[joint]), 1.0 * 0.005 + 1e-3);
    }
    before = robot.command.velocity;
    if (robot.state() != MotionState::Running) break;
    // A straight line in joint space: all joints are equally far on their way.
    const JointVector share = (robot.sample.position - start).cwiseQuotient(target - start);
    ASSERT_LT(share.maxCoeff() - share.minCoeff(), 1e-3);
  }
  EXPECT_EQ(robot.state(), MotionState::Reached);
  EXPECT_LT((robot.sample.position - target).lpNorm<Eigen::Infinity>(), 1e-6);
  EXPECT_EQ(executed(robot.ptp()), std::vector<int>{answer.id});
}

TEST(PtpController, StandsStillAtScaleZeroAndGoesOn) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  ASSERT_EQ(robot.ptp().add({kThere, {}, {}}).status, MotionAnswer::kStarted);
  for (int i = 0; i < 60; ++i) robot.tick();
  robot.manager->setSpeedScale(0.0);
  for (int i = 0; i < 300; ++i) robot.tick();
  EXPECT_LT(robot.command.velocity.norm(), 1e-6);
  EXPECT_EQ(robot.state(), MotionState::Running);
  robot.manager->setSpeedScale(1.0);
  for (int i = 0; i < 3000; ++i) robot.tick();
  EXPECT_EQ(robot.state(), MotionState::Reached);
}

/// A request in a thread of its own, while this one runs the cycle.
template <typename Request>
void during(VirtualRobot& robot, Request&& request) {
  std::atomic<bool> done{false};
  std::thread thread([&] {
    request();
    done = true;
  });
  while (!done) {
    robot.tick();
    std::this_thread::sleep_for(std::chrono::microseconds(100));
  }
  thread.join();
}

TEST(PtpController, MotionThatRacesAHoldIsNotMadeAfterReset) {
  using coglab_rt::MotionBlock;
  for (const bool split : {false, true}) {
    VirtualRobot robot("plan_timeout: 30.0", 0.005, false);
    during(robot, [&] { robot.loadBoth("ptp"); });
    MotionAnswer first, second;
    during(robot, [&] { first = robot.ptp().add({kThere, {}, {}}); });
    for (int i = 0; i < 2000 && robot.state() != MotionState::Reached; ++i) robot.tick();
    ASSERT_EQ(executed(robot.ptp()), std::vector<int>{first.id});
    // The request is checked while the arm may move, and adopted by the first cycle with the hold.
    std::atomic<bool> answered{false};
    std::thread request([&] {
      second = robot.ptp().add({{0, 0, 0, 1, 0, 0, 0}, {}, {}});
      answered = true;
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    robot.sample.block = MotionBlock::Held;
    ++robot.sample.motion_epoch;
    // on a busy computer the request may come later than this cycle
    do {
      robot.tick();
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    } while (!answered);
    request.join();
    const JointVector stood = robot.sample.position;
    if (!split) ++robot.sample.motion_epoch;  // a robot behind topics counts the hold alone
    robot.sample.block = MotionBlock::None;
    for (int i = 0; i < 200; ++i) robot.tick();
    EXPECT_EQ(second.status, MotionAnswer::kRejected);
    EXPECT_TRUE(second.code == ReasonCode::TooLate || second.code == ReasonCode::Held);
    EXPECT_TRUE(executed(robot.ptp()).empty());
    EXPECT_EQ(robot.sample.position, stood);
  }
}

/// The least distance of the hand to a border of the workspace on the straight way in joint space,
/// m; negative: outside.
double roomOnTheWay(const VirtualRobot& robot, const JointVector& from, const JointVector& to) {
  const RobotSetup& setup = *robot.manager->settings().robot;
  const Workspace workspace(setup.guard.workspace, setup.chain.reach());
  double least = 1.0;
  for (int step = 0; step <= 400; ++step) {
    const JointVector q = from + step / 400.0 * (to - from);
    std::array<Workspace::Margin, Workspace::kBorders> margins;
    workspace.margins(setup.chain, setup.chain.evaluate(q), JointVector::Zero(), margins);
    for (const Workspace::Margin& margin : margins) {
      if (margin.border != WorkspaceBorder::None) least = std::min(least, margin.distance);
    }
  }
  return least;
}

/// A motion from its first cycle to its last, within the speed limits.
void whole(VirtualRobot& robot) {
  robot.tick();
  for (int i = 0; i < 20000 && robot.state() == MotionState::Running; ++i) {
    robot.tick();
    ASSERT_TRUE(
        (robot.command.velocity.cwiseAbs().array() <= robot.limits.velocity.array() + 1e-9).all());
  }
}

/// A motion is refused only for its target. The geometry of its path determines the result: a path
/// away from all borders reaches its target; a path that leaves the workspace aborts. Within 10 mm
/// of a border, where the guard slows the arm, both are possible.
TEST(PtpController, RandomMotionsEndExactly) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> share(-0.6, 0.6);
  VirtualRobot robot;
  robot.loadBoth("ptp");
  const RobotSetup& setup = *robot.manager->settings().robot;
  constexpr double kNear = 0.01;  // m
  int reached = 0, rejected = 0, aborted = 0, clear = 0, leaving = 0;
  std::vector<int> expected, ends;
  for (int run = 0; run < 120; ++run) {
    JointVector to;
    for (double& joint : to) joint = share(random);
    to = to.cwiseProduct(robot.limits.upper_position);
    const JointVector from = robot.sample.position;
    const std::vector<double> target(to.data(), to.data() + 7);
    const MotionAnswer answer = robot.ptp().add({target, std::vector<double>(7, 1.5), {}});
    const bool inside = setup.workspace.contains(setup.chain.evaluate(to).tool.position);
    ASSERT_EQ(answer.status, inside ? MotionAnswer::kStarted : MotionAnswer::kRejected)
        << answer.message;
    if (!inside) {
      ASSERT_EQ(answer.code, ReasonCode::GoalOutsideWorkspace) << answer.message;
      ++rejected;
      continue;
    }
    const double room = roomOnTheWay(robot, from, to);
    clear += room >= kNear;
    leaving += room <= -kNear;
    whole(robot);
    ASSERT_FALSE(HasFatalFailure());
    const std::vector<int> now = executed(robot.ptp());
    ends.insert(ends.end(), now.begin(), now.end());
    if (robot.state() == MotionState::Aborted) {
      ++aborted;
      ASSERT_EQ(robot.manager->report().reason.code(), ReasonCode::WorkspaceBorder)
          << robot.reason();
      ASSERT_LT(room, kNear) << "nothing was in its way";
      // Back the way it came is free.
      const MotionAnswer back = robot.ptp().add({{from.data(), from.data() + 7}, {}, {}});
      ASSERT_EQ(back.status, MotionAnswer::kStarted) << back.message;
      whole(robot);
      ASSERT_EQ(robot.state(), MotionState::Reached) << robot.reason();
      expected.push_back(back.id);
      continue;
    }
    ASSERT_EQ(robot.state(), MotionState::Reached) << robot.reason();
    ++reached;
    expected.push_back(answer.id);
    ASSERT_GT(room, -kNear) << "its way leaves the workspace";
    ASSERT_LT((robot.sample.position - to).lpNorm<Eigen::Infinity>(), 2e-3);
  }
  EXPECT_EQ(ends, expected);
  EXPECT_EQ(reached + aborted + rejected, 120);
  EXPECT_GT(clear, 0);
  EXPECT_GE(reached, clear);
  EXPECT_GT(leaving, 0);
  EXPECT_GE(aborted, leaving);
}

TEST(PtpController, NeedsAllSevenJoints) {
  VirtualRobot robot("tool_link: lwr_link_6");
  EXPECT_TRUE(refused(robot.manager->load("ptp", "coglab/PtpController"), {"seven joints"}));
}

}  // namespace
}  // namespace coglab_controllers
