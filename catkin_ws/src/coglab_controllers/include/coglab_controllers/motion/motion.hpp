/// @file
/// Base class for new arm motions. A motion overrides four methods and needs no ROS. MotionRunner
/// does the rest: requests, queue, braking, holding, arriving and joint control.
#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/manager/tunables.hpp"
#include "coglab_controllers/motion/motion_reference.hpp"

namespace coglab_controllers {

/// One numeric argument of a motion request (service start_motion).
struct MotionArgument {
  std::string name, unit;
  double fallback = 0.0;           ///< value if the request does not give one
  double least = 0.0, most = 0.0;  ///< range; a request outside it is refused
};

/// Index of an argument, returned by MotionConfiguration::argument().
struct ArgumentIndex {
  std::size_t value = 0;
};

/// A request for a motion: one number for each argument that the motion declared. Fixed size, so
/// that the control cycle can copy it.
struct MotionArguments {
  static constexpr std::size_t kMost = 16;

  std::array<double, kMost> values{};
  double operator[](ArgumentIndex index) const noexcept { return values[index.value]; }
};

/// Input of configure(): robot and parameters. It also collects the declared arguments.
class MotionConfiguration {
 public:
  /// @param tunables gets the gains that the motion declares; outlives the motion
  MotionConfiguration(const MotionSetup& motion_setup, Tunables& tunables)
      : setup(motion_setup),
        robot(*motion_setup.robot),
        parameters(motion_setup.parameters, motion_setup.id),
        tunables_(tunables) {}

  /// Declares a numeric request argument. A parameter of the same name changes its default.
  /// @throws std::runtime_error if there are more than MotionArguments::kMost
  ArgumentIndex argument(const std::string& name, const std::string& unit, double fallback,
                         double least, double most) {
    if (arguments_.size() == MotionArguments::kMost) {
      throw std::runtime_error("a motion has at most " + std::to_string(MotionArguments::kMost) +
                               " arguments; '" + name + "' is one more");
    }
    arguments_.push_back({name, unit, parameters.number(name, fallback, least, most), least, most});
    return {arguments_.size() - 1};
  }
  /// Declares a gain that may change while the motion runs (dynamic_reconfigure). Its first value
  /// is the parameter of the same name. The cycle calls Tunable::step(). The reference stays valid
  /// as long as the motion.
  Tunable& tunable(const std::string& name, const std::string& text, double fallback, double least,
                   double most) {
    return tunables_.add(parameters, name, text, fallback, least, most);
  }
  const std::vector<MotionArgument>& arguments() const { return arguments_; }

  const MotionSetup& setup;
  const RobotSetup& robot;      ///< model, limits, workspace; outlives the motion
  const Parameters parameters;  ///< below /controller_manager/<id>

 private:
  std::vector<MotionArgument> arguments_;
  Tunables& tunables_;
};

/// State of the set-point at the start of a motion. The first reference must continue it.
/// Poses and velocities are those of the tool frame in the robot's base frame; velocities are per
/// second of the motion's own time.
struct SetPoint {
  JointVector joints = JointVector::Zero();          ///< rad
  JointVector joint_velocity = JointVector::Zero();  ///< rad/s
  Pose pose;
  Vector3 velocity = Vector3::Zero();          ///< m/s
  Vector3 angular_velocity = Vector3::Zero();  ///< rad/s
};

/// Input of start().
template <typename Request = MotionArguments>
struct MotionStart {
  const Request& request;
  const SetPoint& from;
  const CycleInput& input;
};

/// Input of computeReference(). Its time is motion time: it runs slower than the clock while
/// speed_scale or a limit slows the arm.
struct MotionCycle {
  double time = 0.0;  ///< s since the motion began
  double next = 0.0;  ///< s, motion time of the next cycle
  const CycleInput& input;
  const IkResult& last;  ///< inverse kinematics of the last cycle (Cartesian references)
};

/// A motion of the arm, from its start to its end. configure() runs outside of the control cycle;
/// the others run in it and must not allocate, lock, or call the system. Exceptions are caught:
/// the motion is aborted, the arm brakes, and the reason is published.
/// @tparam Request type of the requests; of fixed size, as the control cycle copies it
template <typename Request = MotionArguments>
class Motion {
 public:
  virtual ~Motion() = default;

  /// Reads parameters and declares arguments. @throws std::runtime_error with the parameter,
  /// the expected and the received value
  virtual void configure(MotionConfiguration& configuration) = 0;

  /// A motion begins in this cycle; computeReference() follows at once.
  virtual void start(const MotionStart<Request>& start) = 0;

  /// Sets the reference for this cycle and the next one, or rest.
  virtual void computeReference(const MotionCycle& cycle, MotionReference& reference) = 0;

  /// Running or Holding during the motion; Reached once its reference has ended (the
  /// runner then waits until the arm arrives); Aborted if it failed.
  virtual MotionState state() const = 0;

  /// @name Optional
  /// @{

  /// Reason for Holding or Aborted.
  virtual const Reason& reason() const {
    static const Reason none;
    return none;
  }
  /// Called if a limit blocks the motion. Ends it as reached if the arm is at its goal.
  /// @return true if it ended the motion; on false the runner aborts it
  virtual bool endIfThere(const CycleInput& /*input*/) { return false; }
  /// Called if the motion is cancelled or replaced, or if its controller becomes inactive.
  virtual void stop() noexcept {}
  /// @}
};

}  // namespace coglab_controllers
