/// @file
/// An arm in virtual time, for tests of motions: the real controller manager, and an arm that
/// follows it. No ROS, no threads; one simulated second takes a few milliseconds.
#pragma once

#include <cstdint>
#include <fstream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_rt/braking.hpp"
#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_controllers {

inline std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Start posture of the arm, rad: the home posture of the robots.
inline const JointVector kHome =
    (JointVector() << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782).finished();

/// Manager, arm and clock. The arm follows velocities at once and exactly; after
/// followWithinLimits(), it follows like the robot's interface. Only tick() advances the time.
class VirtualArm {
 public:
  /// @param description folder of the package lwr_description
  /// @param parameters YAML text as below /controller_manager
  /// @param lockstep false: requests wait until another thread calls tick()
  explicit VirtualArm(const std::string& description, const std::string& parameters = "",
                      double cycle = 0.005, bool lockstep = true)
      : period(cycle),
        limits(coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml")) {
    ManagerSettings settings = readManagerSettings(
        YAML::Load(parameters), readText(description + "/urdf/lwr_ih2.urdf"), limits, lockstep);
    settings.cycle.overrun_time = 0.0;
    settings.clock = [this] { return now_ns; };
    settings.logger = &logger;
    manager = std::make_unique<ControllerManager>(std::move(settings));
    sample.position = kHome;
    sample.commanded_position = sample.position;
    sample.block = MotionBlock::None;
    sample.cycle_time = period;
    sample.stop_delay = coglab_rt::lostTime(period);  // as in the bridge
    sample.stop_rounding = 2.0 * coglab_rt::kWireRounding;
    tick();
  }
  virtual ~VirtualArm() = default;
  VirtualArm(const VirtualArm&) = delete;
  VirtualArm& operator=(const VirtualArm&) = delete;

  /// Loads a motion and makes it the active controller. @throws std::runtime_error with the refusal
  CustomMotionController& load(const std::string& id, const std::string& type) {
    std::string active;
    Answer answer = manager->load(id, type);
    if (answer.success) answer = manager->switchTo(id, active);
    if (!answer.success) throw std::runtime_error(answer.message);
    return dynamic_cast<CustomMotionController&>(*manager->motion(id));
  }

  /// From now on the arm follows within its acceleration and jerk limits.
  void followWithinLimits() {
    interpolator = std::make_unique<coglab_rt::Interpolator>(limits);
    interpolator->reset(sample.position);
  }

  /// One measurement and one cycle; the arm then follows for one period.
  const VelocityCommand& tick() {
    const auto passed_ns = static_cast<std::int64_t>(period * 1e9);
    now_ns += passed_ns;
    ++sample.sequence;
    sample.stamp_ns = now_ns;
    sample.controller_ns += passed_ns;
    beforeCycle();
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
  /// Runs cycles for a number of seconds.
  void run(double seconds) {
    for (double t = 0.0; t < seconds - 1e-9; t += period) tick();
  }

  Pose hand() const { return manager->settings().robot->chain.evaluate(sample.position).tool; }
  Vector3 handVelocity() const {
    const ChainState state = manager->settings().robot->chain.evaluate(sample.position);
    return (state.jacobian * sample.velocity).head<3>();
  }
  MotionState state() const { return manager->report().motion; }
  std::string reason() const { return manager->report().reason.str(); }

  double period;
  std::int64_t now_ns = 1'000'000'000;
  coglab_rt::JointLimits limits;
  ctrl_more::Logger logger;  // without sinks
  std::unique_ptr<ControllerManager> manager;
  std::unique_ptr<coglab_rt::Interpolator> interpolator;  // null: the arm follows at once
  RobotSample sample;
  VelocityCommand command;

 private:
  /// Callback between two cycles.
  virtual void beforeCycle() {}
};

}  // namespace coglab_controllers
