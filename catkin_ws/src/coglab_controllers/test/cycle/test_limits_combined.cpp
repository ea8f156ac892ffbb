// The shipped feedback list, guard, limits and interpolator together: motions near the ends of the
// joint ranges stay on their path, arrive and cause no fault.
#include <random>

#include "coglab_rt/braking.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const std::string kShipped = "feedback_file: " PACKAGE_DIR "/../ctrl_more/config/feedback.yaml";

/// The arm follows its set-point with a delay and measures with noise. The bridge bounds the speed
/// toward a limit.
class DelayedRobot : public VirtualRobot {
 public:
  explicit DelayedRobot(const std::string& parameters)
      : VirtualRobot(parameters), bound_(limits, limits.position_margin) {
    followWithinLimits();
    arm_ = sample.position;
  }

  void tick() {
    now_ns += 5'000'000;
    ++sample.sequence;
    sample.stamp_ns = now_ns;
    if (active_dmp) dmp().pollGoal();
    manager->cycle().run(sample, period, command);
    JointVector velocity = command.velocity;
    cuts += bound_.bound(*interpolator, period, velocity) != 0 ? 1 : 0;
    interpolator->step(velocity, period);
    arm_ += (1.0 - std::exp(-period / 0.015)) * (interpolator->position() - arm_);
    sample.velocity = (arm_ - last_) / period;
    last_ = arm_;
    sample.position = arm_;
    for (int joint = 0; joint < kMaxJoints; ++joint) sample.position[joint] += noise_(random_);
    sample.commanded_position = interpolator->position();
    sample.commanded_velocity = interpolator->velocity();
    sample.commanded_acceleration = interpolator->acceleration();
    const JointVector inside = (limits.upper_position - sample.commanded_position)
                                   .cwiseMin(sample.commanded_position - limits.lower_position);
    least_room = std::min(least_room, inside.minCoeff());
  }

  bool active_dmp = false;
  int cuts = 0;             // cycles in which the bridge had to cut the velocity of a joint
  double least_room = 1.0;  // rad between set-point and the nearest end of a range

 private:
  coglab_rt::BrakingGuard bound_;
  JointVector arm_ = JointVector::Zero(), last_ = JointVector::Zero();
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0.0, 5e-5};
};

double uniform(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// True if the hand stays well inside the workspace on the straight path in joint space.
bool staysInside(const RobotSetup& robot, const JointVector& from, const JointVector& to) {
  std::array<Workspace::Margin, Workspace::kBorders> margins;
  for (int i = 50; i >= 0; --i) {
    const ChainState state = robot.chain.evaluate(JointVector(from + 0.02 * i * (to - from)));
    robot.workspace.margins(robot.chain, state, JointVector::Zero(), margins);
    for (const auto& margin : margins) {
      if (margin.distance < (i == 50 ? 0.1 : 0.05)) return false;
    }
  }
  return true;
}

void expectNoFault(DelayedRobot& robot) {
  EXPECT_EQ(robot.manager->report().faults, 0u) << robot.reason();
  for (const ctrl_more::ControllerStatus& status : robot.manager->feedback().statusAll()) {
    EXPECT_EQ(status.faults, 0u) << status.name << ": " << status.fault_text;
  }
}

TEST(LimitsCombined, TargetsNearTheEndsOfTheRangesAreReachedOnAStraightPath) {
  for (const bool narrowed : {false, true}) {
    DelayedRobot robot("{" + kShipped +
                       (narrowed ? ", lower_joint_pos_limit: [-2.5, -1.8, -2.5, -1.7, -2.5, -1.6, "
                                   "-2.4], upper_joint_pos_limit: [2.5, 1.8, 2.5, 1.9, 2.5, 1.6, "
                                   "2.4], position_margin: 0.02}"
                                 : "}"));
    ASSERT_TRUE(robot.manager->feedbackErrors().empty()) << robot.manager->feedbackErrors()[0];
    robot.loadBoth("ptp");
    const RobotSetup& setup = *robot.manager->settings().robot;
    const double margin = setup.guard.position_margin + 0.002;  // of the guard, and `tolerance`
    std::mt19937 random(11);
    int near = 0;
    double off_path = 0.0;
    for (int run = 0; run < 60; ++run) {
      for (int i = 0; i < 400 && !robot.manager->report().standing; ++i) robot.tick();
      const JointVector from = robot.sample.commanded_position;
      JointVector to;
      int tries = 0;
      do {
        ASSERT_LT(++tries, 100000) << from.transpose();
        for (int joint = 0; joint < kMaxJoints; ++joint) {
          const double lower = setup.limits.lower_position[joint] + margin;
          const double upper = setup.limits.upper_position[joint] - margin;
          const double room = uniform(random, 0.0, 1.0) < 0.3 ? 0.0 : uniform(random, 0.0, 0.2);
          const bool end = uniform(random, 0.0, 1.0) < 0.5;
          to[joint] = !end                              ? uniform(random, lower, upper)
                      : uniform(random, 0.0, 1.0) < 0.5 ? lower + room
                                                        : upper - room;
        }
      } while (!staysInside(setup, from, to));
      const JointVector distance =
          (setup.limits.upper_position - to).cwiseMin(to - setup.limits.lower_position);
      near += distance.minCoeff() < 0.03 ? 1 : 0;
      const std::vector<double> target(to.data(), to.data() + 7);
      const JointVector speed = uniform(random, 0.2, 1.0) * setup.limits.velocity;
      const JointVector acceleration = uniform(random, 0.1, 0.5) * setup.limits.acceleration;
      const MotionAnswer answer = robot.ptp().add({target,
                                                   {speed.data(), speed.data() + 7},
                                                   {acceleration.data(), acceleration.data() + 7}});
      ASSERT_EQ(answer.status, MotionAnswer::kStarted) << answer.message;
      const JointVector way = (to - from).normalized();
      for (int i = 0; i < 6000; ++i) {
        robot.tick();
        const JointVector gone = robot.sample.commanded_position - from;
        off_path = std::max(off_path, (gone - way.dot(gone) * way).norm());
        if (i > 2 && robot.state() != MotionState::Running) break;
      }
      ASSERT_EQ(robot.state(), MotionState::Reached) << robot.reason() << " to " << to.transpose();
      ASSERT_LT((robot.sample.position - to).lpNorm<Eigen::Infinity>(), 0.0025);
    }
    EXPECT_GT(near, 15);
    EXPECT_LT(off_path, 0.005);
    EXPECT_GE(robot.least_room, setup.guard.position_margin - 1e-3);
    EXPECT_EQ(robot.cuts, 0);
    expectNoFault(robot);
  }
}

/// The guard may only narrow the table. With a smaller margin it would pass motions that the arm's
/// interface stops; with a wider range, motions that the arm cannot do.
TEST(LimitsCombined, ParametersNarrowTheTableAndNeverWidenIt) {
  const auto refusal = [](const std::string& parameters) {
    try {
      VirtualRobot robot("{" + parameters + "}");
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("position_margin: 0.01"), "");
  EXPECT_EQ(refusal("position_margin: 0.03"), "");
  EXPECT_EQ(refusal("upper_joint_pos_limit: [2.9, 2.0, 2.9, 2.0, 2.9, 2.0, 2.9]"), "");
  for (const std::string wrong : {"0.009", "0.0", "-0.01", "0.6", ".nan"}) {
    const std::string said = refusal("position_margin: " + wrong);
    EXPECT_NE(said.find("position_margin"), std::string::npos) << wrong << ": " << said;
  }
  for (const std::string wrong : {"upper_joint_pos_limit: [2.9, 2.0, 2.9, 2.1, 2.9, 2.0, 2.9]",
                                  "lower_joint_pos_limit: [-2.9, -2.0, -2.9, -2.1, -2.9, -2, -2]",
                                  "joint_vel_limit: [1, 1, 1, 2, 1, 1, 1]"}) {
    const std::string said = refusal(wrong);
    EXPECT_NE(said.find("joint 4"), std::string::npos) << wrong << ": " << said;
  }
}

TEST(LimitsCombined, TheMeasuredArmAndNotTheSetPointDecidesReached) {
  for (const std::string active : {"ptp", "dmp"}) {
    VirtualRobot robot;
    robot.loadBoth(active);
    const Vector3 goal(0.80, 0.0, 0.45);
    robot.see("human_hand", goal);
    if (active == "ptp") {
      ASSERT_EQ(robot.ptp().add({{-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6}, {}, {}}).status,
                MotionAnswer::kStarted);
    } else {
      ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
    }
    JointVector commanded = robot.sample.position, stuck = commanded;
    int i = 0;
    for (; i < 3000 && robot.state() != MotionState::Aborted; ++i) {
      robot.see("human_hand", goal);
      robot.tick();
      // The bridge keeps its set-point on a leash.
      commanded = (commanded + robot.period * robot.command.velocity)
                      .cwiseMin(stuck + JointVector::Constant(0.05))
                      .cwiseMax(stuck - JointVector::Constant(0.05));
      if (i < 150) stuck = commanded = robot.sample.position;
      robot.sample.position = stuck;  // the arm is blocked in the middle of its path
      robot.sample.velocity.setZero();
      robot.sample.commanded_position = commanded;
      ASSERT_NE(robot.state(), MotionState::Reached) << active;
    }
    EXPECT_EQ(robot.state(), MotionState::Aborted) << active;
    EXPECT_EQ(robot.manager->report().reason.code(), ReasonCode::TargetNotReached)
        << robot.reason();
  }
}

TEST(LimitsCombined, PushedReachesNearTheEndsOfTheRangesCauseNoFault) {
  DelayedRobot robot("{" + kShipped + "}");
  robot.loadBoth("ptp");
  std::mt19937 random(12);
  int reached = 0, blocked = 0;
  for (int run = 0; run < 25; ++run) {
    robot.active_dmp = false;
    robot.switchTo("ptp");
    std::vector<double> home(kHome.data(), kHome.data() + kHome.size());
    home[4] = uniform(random, -2.9, 2.9);  // a wrist near the end of its range
    home[6] =
        uniform(random, 0.0, 1.0) < 0.5 ? uniform(random, 2.6, 2.95) : uniform(random, -2.95, -2.6);
    ASSERT_EQ(robot.ptp().add({home, {}, {}}).status, MotionAnswer::kStarted);
    for (int i = 0; i < 4000 && (i < 3 || robot.state() == MotionState::Running); ++i) robot.tick();
    robot.active_dmp = true;
    robot.switchTo("dmp");
    ASSERT_TRUE(VirtualRobot::ok(robot.manager->applyProfile("dmp_compliant")));
    const Vector3 goal(uniform(random, 0.55, 0.8), uniform(random, -0.3, 0.3),
                       uniform(random, 0.35, 0.7));
    robot.see("human_hand", goal);
    DmpRequest request = robot.reach();
    request.orientation_control = true;
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
    for (int i = 0; i < 1200; ++i) {
      robot.see("human_hand", goal);
      if (i % 200 == 100) {
        for (int k = 0; k < 3; ++k) robot.sample.tool_wrench[k] = uniform(random, -15.0, 15.0);
      }
      if (i % 200 == 160) robot.sample.tool_wrench.setZero();
      robot.tick();
      if (robot.state() == MotionState::Aborted) break;
    }
    robot.sample.tool_wrench.setZero();
    reached += robot.state() == MotionState::Reached ? 1 : 0;
    const ReasonCode why = robot.manager->report().reason.code();
    EXPECT_TRUE(robot.state() == MotionState::Reached || why == ReasonCode::JointBlocked ||
                why == ReasonCode::WorkspaceBorder)
        << nameOf(robot.state()) << ": " << robot.reason();
    if (why != ReasonCode::JointBlocked) continue;
    // The sentence names the joint, and that one is at its stop.
    int named = -1;
    for (int joint = 0; joint < kMaxJoints; ++joint) {
      const std::string& name = robot.manager->settings().robot->chain.jointNames()[joint];
      if (robot.reason().find("joint " + name + " ") == 0) named = joint;
    }
    ASSERT_GE(named, 0) << robot.reason();
    EXPECT_LT(std::min(robot.limits.upper_position[named] - robot.sample.position[named],
                       robot.sample.position[named] - robot.limits.lower_position[named]),
              robot.limits.position_margin + 0.02);
    ++blocked;
  }
  EXPECT_GT(reached, 12);
  EXPECT_GT(blocked, 0);
  EXPECT_GE(robot.least_room, robot.limits.position_margin - 2e-3);
  EXPECT_EQ(robot.cuts, 0);
  expectNoFault(robot);
}

}  // namespace
}  // namespace coglab_controllers
