// The manager's cycle and the bridge while datagrams are lost: checks the statements of
// docs/limits_under_loss.md about the two guards.
#include <random>
#include <sstream>

#include "loss_campaign.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

using lwr_fri_bridge::Bridge;
using lwr_fri_bridge::test::LossPattern;
using lwr_fri_bridge::test::SmallController;

struct Case {
  double period;  // s
  double share;   // of the cycles that lose a datagram
  bool bursts;
};

/// Manager, bridge and robot controller, in the order of the robot: a measurement, its answer, and
/// the manager's cycle with that measurement.
class BridgedRobot : public VirtualRobot {
 public:
  BridgedRobot(const Case& c, unsigned seed)
      : VirtualRobot("{feedback_file: " PACKAGE_DIR "/../ctrl_more/config/feedback.yaml}",
                     c.period),
        bridge(lwr_fri_bridge::test::defaultConfig()),
        robot_(c.period),
        loss_(c.share, c.bursts, seed) {
    robot_.moveOwn(kHome);
    robot_.setMeasured(kHome);
    for (int i = 0; i < 3; ++i) robot_.cycle(bridge);
    started = lwr_fri_bridge::test::runEvent(bridge, robot_, "start").success();
    loadBoth("ptp");
    step();
    last_set_point_ = setPoint();
  }

  void step() {
    const LossPattern::Lost lost = loss_.next();
    robot_.cycle(bridge, lost == LossPattern::Lost::Measurement, lost == LossPattern::Lost::Answer);
    now_ns = robot_.now();
    fastest = std::max(fastest, (setPoint() - last_set_point_).lpNorm<Eigen::Infinity>() / period);
    last_set_point_ = setPoint();
    coglab_rt::RobotSample seen;
    bridge.mailboxes().newestSample(seen);
    if (seen.sequence == last_.sequence) return;
    const double passed = 1e-9 * static_cast<double>(seen.controller_ns - last_.controller_ns);
    const double dt = last_.sequence == 0 ? period : passed;
    last_ = sample = seen;
    // As ControlThread hands it over.
    manager->cycle().run(sample, std::min(dt, manager->cycle().settings().sample_timeout), command);
    bridge.mailboxes().sendVelocity(command);
  }

  JointVector setPoint() const { return robot_.setPoint(); }
  unsigned long cuts() { return bridge.snapshot().counters.position_bounds; }

  Bridge bridge;
  bool started = false;
  double fastest = 0.0;  // rad/s of any joint

 private:
  SmallController robot_;
  LossPattern loss_;
  coglab_rt::RobotSample last_;
  JointVector last_set_point_ = kHome;
};

/// Results of the motions of one case.
struct Found {
  unsigned long cuts = 0;   // cycles in which the bridge cut a joint's velocity
  double off_path = 0.0;    // rad
  double least_room = 1.0;  // rad from a set-point to the end of its range, less the margin
  int near = 0, motions = 0, reached = 0;
};

/// Moves between the home posture and postures with some joints at their limits.
Found motions(const Case& c, double speed, unsigned seed, int count) {
  BridgedRobot robot(c, seed);
  EXPECT_TRUE(robot.started);
  Found found;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> part(0.0, 1.0);
  const RobotSetup& setup = *robot.manager->settings().robot;
  const coglab_rt::JointLimits& limits = setup.limits;
  const double margin = setup.guard.position_margin;
  const JointVector v = speed * limits.velocity, a = 0.5 * limits.acceleration;
  for (int run = 0; run < count; ++run) {
    JointVector to = kHome;
    // These joints do not lead the hand out of its workspace, wherever they are.
    for (const int joint : {4, 6}) {
      const double room = margin + 0.002 + (part(random) < 0.5 ? 0.0 : 0.05 * part(random));
      const bool up = part(random) < 0.5;
      if (run % 2 == 0)
        to[joint] = up ? limits.upper_position[joint] - room : limits.lower_position[joint] + room;
    }
    const JointVector from = robot.setPoint(), way = (to - from).normalized();
    if ((to - from).norm() < 0.1) continue;
    found.near += run % 2 == 0 ? 1 : 0;
    const MotionAnswer answer = robot.ptp().add(
        {{to.data(), to.data() + 7}, {v.data(), v.data() + 7}, {a.data(), a.data() + 7}});
    EXPECT_EQ(answer.status, MotionAnswer::kStarted) << answer.message;
    ++found.motions;
    for (double t = 0.0; t < 40.0; t += c.period) {
      robot.step();
      const JointVector gone = robot.setPoint() - from;
      found.off_path = std::max(found.off_path, (gone - way.dot(gone) * way).norm());
      const JointVector room = (limits.upper_position - robot.setPoint())
                                   .cwiseMin(robot.setPoint() - limits.lower_position);
      found.least_room = std::min(found.least_room, room.minCoeff() - margin);
      if (t > 0.2 && robot.state() != MotionState::Running && robot.manager->report().standing)
        break;
    }
    found.reached += robot.state() == MotionState::Reached ? 1 : 0;
  }
  found.cuts = robot.cuts();
  return found;
}

const double kPeriods[] = {0.001, 0.002, 0.005, 0.01, 0.02};  // s
const double kSpeeds[] = {0.2, 0.5, 1.0};                     // shares of the limits

void expectArrived(const Found& found, const Case& c, double speed) {
  const auto where = [&] {
    std::ostringstream text;
    text << c.period << " s, " << c.share << (c.bursts ? " in bursts" : "") << ", speed " << speed;
    return text.str();
  };
  EXPECT_GT(found.near, 0) << where();
  EXPECT_EQ(found.reached, found.motions) << where();
  EXPECT_GE(found.least_room, 0.0) << where();
}

TEST(LimitsUnderLoss, WithoutBurstsTheBridgeCutsNothingAndThePathIsStraight) {
  unsigned seed = 0;
  for (const double period : kPeriods) {
    for (const double speed : kSpeeds) {
      for (const double share : {0.0, 0.01, 0.1}) {
        const Case c{period, share, false};
        const Found found = motions(c, speed, ++seed, 6);
        expectArrived(found, c, speed);
        EXPECT_EQ(found.cuts, 0u) << period << " s, " << share << ", speed " << speed;
        EXPECT_LT(found.off_path, 0.015) << period << " s, " << share << ", speed " << speed;
      }
    }
  }
}

TEST(LimitsUnderLoss, BurstsAtHalfSpeedOrShortPeriodsMakeTheBridgeCutNothing) {
  unsigned seed = 100;
  for (const double period : kPeriods) {
    for (const double speed : kSpeeds) {
      if (speed > 0.5 && period > 0.002) continue;
      const Case c{period, 0.1, true};
      const Found found = motions(c, speed, ++seed, 6);
      expectArrived(found, c, speed);
      EXPECT_EQ(found.cuts, 0u) << period << " s, speed " << speed;
    }
  }
}

/// Here the distance of the manager is not sufficient. The bridge cuts the motion for some cycles,
/// and so the limits hold.
TEST(LimitsUnderLoss, LimitsHoldWithBurstsAndLongPeriods) {
  unsigned long cuts = 0;
  int all = 0;
  for (const double period : {0.005, 0.01, 0.02}) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
      const Case c{period, 0.1, true};
      const Found found = motions(c, 1.0, 7 * seed, 10);
      expectArrived(found, c, 1.0);
      cuts += found.cuts;
      all += found.motions;
    }
  }
  EXPECT_GT(cuts, 0u) << "then docs/limits_under_loss.md and braking.hpp say less than holds";
  EXPECT_LT(cuts, static_cast<unsigned long>(all));
}

}  // namespace
}  // namespace coglab_controllers
