// Feedback controllers during STOP, reset and cancel, with the shipped list for the sensors in the
// palm.
#include <algorithm>
#include <random>
#include <vector>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

constexpr double kTilt = 0.06;  // rad, mounting error of the IMU

/// The arm with the shipped list. Its IMU is tilted and noisy, and a person may push the palm.
class PalmRobot : public VirtualRobot {
 public:
  PalmRobot()
      : VirtualRobot("{feedback_file: " PACKAGE_DIR "/config/palm.yaml, plugin_paths: [" PLUGIN_DIR
                     "]}") {
    followWithinLimits();
    senses = true;
  }
  ctrl_more::Activity activity(const std::string& controller) const {
    return manager->feedback().status(controller).activity;
  }
  /// As STOP and reset do at the robot.
  void block(MotionBlock why) {
    sample.block = why;
    ++sample.motion_epoch;
  }
  void beginReach() {
    see("human_hand", hand().position + Vector3(0.1, 0.2, 0.1), hand().orientation);
    const Answer answer = dmp().execute(reach());
    ASSERT_TRUE(answer.success) << answer.message;
  }
  /// Seconds until the set-point stands; 10 if it does not.
  double rest() {
    double waited = 0.0;
    for (; waited < 10.0 && !manager->report().standing; waited += period) tick();
    return waited;
  }
  /// Runs and returns the largest speed of the hand: m/s, rad/s.
  std::pair<double, double> fastest(double seconds) {
    std::pair<double, double> most(0.0, 0.0);
    for (double t = 0.0; t < seconds; t += period) {
      tick();
      const ChainState state = manager->settings().robot->chain.evaluate(sample.position);
      const Eigen::Matrix<double, 6, 1> twist = state.jacobian * sample.velocity;
      most.first = std::max(most.first, twist.head<3>().norm());
      most.second = std::max(most.second, twist.tail<3>().norm());
    }
    return most;
  }

  Vector3 push = Vector3::Zero();  // N, axes of the palm
  bool senses = false;

 private:
  void beforeCycle() override {
    if (!senses) return;
    if (MotionController* motion = manager->motion("dmp")) {
      static_cast<DmpController*>(motion)->pollGoal();
    }
    for (auto& [name, frame] : frames.frames) frame.stamp_ns = frame.frame_ns = now_ns;
    std::normal_distribution<double> noise(0.0, 0.003);
    const Vector3 turn(kTilt + noise(random_), noise(random_), noise(random_));
    const Quaternion seen = expRotation(turn) * hand().orientation;
    post(0, {{seen.x(), seen.y(), seen.z(), seen.w()},
             {noise(random_), noise(random_), noise(random_)},
             {0.0, 0.0, 9.81}});
    const std::vector<double> wrench = {push.x(), push.y(), push.z(), 0.0, 0.0, 0.0};
    post(1, {{}, {}, wrench});
  }
  void post(std::size_t row, const std::vector<std::vector<double>>& fields) {
    SignalMessage message;
    message.stamp_ns = now_ns;
    message.frame = "ih2_palm";
    for (const auto& field : fields) message.fields.push_back({field.data(), field.size()});
    const SignalPost taken = manager->feedbackStage().signals().post(row, message, now_ns);
    ASSERT_EQ(taken.refusal, SignalRefusal::None) << taken.text;
  }

  std::mt19937 random_{5};
};

struct Stop : ::testing::Test {
  PalmRobot robot;
  void SetUp() override {
    ASSERT_TRUE(robot.manager->feedbackErrors().empty()) << robot.manager->feedbackErrors().front();
    robot.loadBoth("dmp");
  }
  /// A plug-in of motions whose profile is this.
  void use(const std::string& profile) {
    ASSERT_TRUE(robot.manager->feedback().applyProfile(profile).ok());
  }
};

TEST_F(Stop, TheSetPointRestsAndCorrectionsComeBackAfterReset) {
  robot.beginReach();
  robot.run(0.4);
  ASSERT_EQ(robot.activity("attitude"), ctrl_more::Activity::Running);
  ASSERT_EQ(robot.state(), MotionState::Running);
  robot.block(MotionBlock::Held);
  EXPECT_LT(robot.rest(), 0.6);
  const JointVector stopped = robot.sample.position;
  for (int i = 0; i < 200; ++i) {
    robot.tick();
    ASSERT_TRUE(robot.manager->report().standing);
  }
  EXPECT_EQ(robot.sample.position, stopped);
  EXPECT_EQ(robot.manager->feedback().status("attitude").waiting_for, "a motion");

  const Pose before = robot.hand();
  robot.block(MotionBlock::None);
  const auto [speed, turning] = robot.fastest(1.0);
  EXPECT_EQ(robot.activity("attitude"), ctrl_more::Activity::Running);
  // The IMU's noise of 0.003 rad shakes the wanted orientation. Each joint follows it within its
  // own limits, so the palm trembles by less than 1 mm, at up to 0.04 m/s.
  EXPECT_LT(speed, 0.05);
  EXPECT_LT(turning, 0.25);
  const Pose after = robot.hand();
  EXPECT_LT((after.position - before.position).norm(), 0.002);
  const double turned = rotationBetween(before.orientation, after.orientation).norm();
  EXPECT_GT(turned, 0.1 * kTilt) << "the correction is back";
  EXPECT_LT(turned, 0.6 * kTilt);

  robot.beginReach();
  robot.run(4.0);
  EXPECT_NE(robot.state(), MotionState::Aborted) << robot.reason();
  EXPECT_EQ(robot.activity("attitude"), ctrl_more::Activity::Running);
}

TEST_F(Stop, ACancelBringsTheArmToRestUntilTheNextMotion) {
  robot.beginReach();
  robot.run(0.4);
  for (int i = 0; i < 2; ++i) {  // the second one while nothing runs
    const CancelOrder order = robot.manager->askCancel("dmp", "test");
    robot.tick();
    CancelAnswer answer;
    EXPECT_LT(robot.rest(), 0.6);
    ASSERT_TRUE(robot.manager->cancelEnded(order, answer));
    EXPECT_TRUE(answer.success) << answer.message;
    EXPECT_EQ(answer.was_running, i == 0);
    for (int k = 0; k < 100; ++k) {
      robot.tick();
      ASSERT_TRUE(robot.manager->report().standing);
    }
  }
  robot.beginReach();
  robot.tick();
  EXPECT_EQ(robot.activity("attitude"), ctrl_more::Activity::Running);
}

// The held pose is corrected in every cycle. If a correction counted twice, the hand would drift
// while a person pushes it.
TEST_F(Stop, APushedHoldingHandYieldsWithoutDrifting) {
  use("dmp_compliant");
  robot.push = Vector3(20.0, 0.0, 0.0);  // 5 N of it are the dead band: 0.075 m on the spring
  robot.beginReach();
  robot.run(0.4);
  ASSERT_EQ(robot.activity("ee_admittance"), ctrl_more::Activity::Running);
  robot.block(MotionBlock::Held);
  EXPECT_LT(robot.rest(), 0.6);
  const Vector3 stood = robot.hand().position;
  robot.block(MotionBlock::None);
  EXPECT_LT(robot.fastest(4.0).first, 0.25) << "its max_velocity";
  EXPECT_NEAR((robot.hand().position - stood).norm(), 0.075, 0.01);
  robot.push.setZero();
  robot.run(4.0);
  EXPECT_LT((robot.hand().position - stood).norm(), 0.01);
}

// A stopped arm may be guided by hand. It then holds its new position.
TEST_F(Stop, AnArmThatWasMovedWhileItWasStoppedStaysThere) {
  robot.block(MotionBlock::Held);
  robot.run(0.1);
  robot.sample.position[0] += 0.3;
  robot.sample.commanded_position = robot.sample.position;
  robot.interpolator->reset(robot.sample.position);
  robot.run(0.1);
  const Vector3 led = robot.hand().position;
  robot.block(MotionBlock::None);
  robot.run(1.0);
  ASSERT_EQ(robot.activity("attitude"), ctrl_more::Activity::Running);
  EXPECT_LT((robot.hand().position - led).norm(), 0.002);
}

}  // namespace
}  // namespace coglab_controllers
