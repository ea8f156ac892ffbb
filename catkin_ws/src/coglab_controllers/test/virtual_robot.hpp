// A controller manager in virtual time with an ideal velocity robot: what the tests of the manager
// share.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_rt/braking.hpp"
#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_controllers {

/// Parameters that name the plug-ins of these tests.
inline const std::string kTypes =
    "types: {test/Misbehaving: libcoglab_test_misbehaving.so, test/Twin: "
    "libcoglab_test_twin.so, test/Empty: libcoglab_test_empty.so, test/Missing: libnowhere.so, "
    "test/Other: libcoglab_test_misbehaving.so, test/Throwing: libcoglab_test_own_exception.so, "
    "test/OtherAbi: libcoglab_test_other_abi.so}, "
    "plugin_paths: [" PLUGIN_DIR "]";

/// Frames as a table.
class FrameTable : public GoalSource {
 public:
  bool lookup(const std::string&, const std::string& frame, GoalObservation& observation,
              std::string& why) override {
    const auto found = frames.find(frame);
    if (found == frames.end()) {
      why = "no such frame";
      return false;
    }
    observation = found->second;
    return true;
  }
  std::map<std::string, GoalObservation> frames;
};

inline std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Manager, robot and clock. The robot follows velocities as `follow` says; by default at once and
/// exactly.
class VirtualRobot {
 public:
  /// @param lockstep false: requests wait until another thread calls tick()
  explicit VirtualRobot(const std::string& parameters = "", double period = 0.005,
                        bool lockstep = true)
      : period(period) {
    limits = coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
    ManagerSettings settings = readManagerSettings(
        YAML::Load(parameters), readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"),
        limits, lockstep);
    settings.cycle.overrun_time = 0.0;
    settings.clock = [this] { return now_ns; };
    settings.plan_timeout = 0.3;
    settings.logger = &logger;
    manager = std::make_unique<ControllerManager>(std::move(settings));
    sample.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample.commanded_position = sample.position;
    sample.block = MotionBlock::None;
    sample.cycle_time = period;
    sample.stop_delay = coglab_rt::lostTime(period);  // as the bridge has it
    sample.stop_rounding = 2.0 * coglab_rt::kWireRounding;
    tick();
  }

  /// From now on the arm follows within its acceleration and jerk limits, as the bridge has it.
  void followWithinLimits() {
    interpolator = std::make_unique<coglab_rt::Interpolator>(limits);
    interpolator->reset(sample.position);
  }

  /// Both plug-ins, the library of the package, and `active`.
  void loadBoth(const std::string& active = "dmp") {
    ASSERT_TRUE(ok(manager->load("dmp", "coglab/DmpController")));
    ASSERT_TRUE(ok(manager->load("ptp", "coglab/PtpController")));
    dmp().setGoalSource(&frames);
    int loaded = 0;
    ASSERT_TRUE(ok(dmp().loadDmps(std::string(PACKAGE_DIR) + "/config/primitives.xml", loaded)));
    ASSERT_GT(loaded, 0);
    switchTo(active);
  }

  void switchTo(const std::string& id) {
    std::string type;
    ASSERT_TRUE(ok(manager->switchTo(id, type)));
  }

  static ::testing::AssertionResult ok(const Answer& answer) {
    return answer.success ? ::testing::AssertionSuccess()
                          : ::testing::AssertionFailure() << answer.message;
  }

  DmpController& dmp() { return dynamic_cast<DmpController&>(*manager->motion("dmp")); }
  PtpController& ptp() { return dynamic_cast<PtpController&>(*manager->motion("ptp")); }

  /// A goal frame seen now.
  void see(const std::string& frame, const Vector3& position,
           const Quaternion& orientation = Quaternion::Identity()) {
    GoalObservation observation;
    observation.position = position;
    observation.orientation = orientation;
    observation.stamp_ns = observation.frame_ns = now_ns;
    frames.frames[frame] = observation;
  }

  /// One measurement and one cycle; the robot then follows for one period.
  const VelocityCommand& tick() {
    now_ns += static_cast<std::int64_t>(period * 1e9);
    ++sample.sequence;
    sample.stamp_ns = now_ns;
    if (MotionController* motion = manager->motion("dmp")) {
      static_cast<DmpController*>(motion)->pollGoal();
    }
    manager->cycle().run(sample, period, command);
    if (sample.block != MotionBlock::None) command.velocity.setZero();
    if (interpolator) {
      interpolator->step(command.velocity, period);
      sample.position = interpolator->position();
      sample.velocity = sample.commanded_velocity = interpolator->velocity();
      sample.commanded_acceleration = interpolator->acceleration();
      sample.commanded_position = sample.position;
      return command;
    }
    sample.commanded_acceleration = (command.velocity - sample.commanded_velocity) / period;
    sample.position += period * command.velocity;
    sample.velocity = command.velocity;
    sample.commanded_velocity = command.velocity;
    sample.commanded_position = sample.position;
    return command;
  }

  Pose hand() const { return manager->settings().robot->chain.evaluate(sample.position).tool; }
  Vector3 handVelocity() const {
    const ChainState state = manager->settings().robot->chain.evaluate(sample.position);
    return (state.jacobian * sample.velocity).head<3>();
  }
  MotionState state() const { return manager->report().motion; }
  std::string reason() const { return manager->report().reason.str(); }

  DmpRequest reach(const std::string& primitive = "reach_human") const {
    DmpRequest request;
    request.primitive_id = primitive;
    request.goal_frame = "human_hand";
    return request;
  }

  double period;
  std::int64_t now_ns = 1'000'000'000;
  coglab_rt::JointLimits limits;
  FrameTable frames;
  ctrl_more::Logger logger;  // without sinks
  std::unique_ptr<ControllerManager> manager;
  std::unique_ptr<coglab_rt::Interpolator> interpolator;  // null: velocities count at once
  RobotSample sample;
  VelocityCommand command;
};

/// A refusal whose sentence has all these words.
inline ::testing::AssertionResult refused(const Answer& answer,
                                          const std::vector<std::string>& words) {
  if (answer.success) return ::testing::AssertionFailure() << "was not refused";
  for (const std::string& word : words) {
    if (answer.message.find(word) == std::string::npos) {
      return ::testing::AssertionFailure() << "'" << answer.message << "' lacks '" << word << "'";
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace coglab_controllers
