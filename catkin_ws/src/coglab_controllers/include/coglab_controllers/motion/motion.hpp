/// @file
/// What somebody writes who wants the arm to move in a way of its own: one class of at most four
/// methods, without ROS. Everything else (requests, queue, braking, holding, arriving, control of
/// the joints) is MotionRunner's.
#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/motion/motion_reference.hpp"

namespace coglab_controllers {

/// One number that a request for a motion may give, as start_motion takes it.
struct MotionArgument {
  std::string name, unit;
  double fallback = 0.0;           ///< used where a request does not name it
  double least = 0.0, most = 0.0;  ///< a request outside of them is refused
};

/// Which argument: what MotionConfiguration::argument() returns.
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

/// What configure() gets and declares.
class MotionConfiguration {
 public:
  explicit MotionConfiguration(const MotionSetup& motion_setup)
      : setup(motion_setup),
        robot(*motion_setup.robot),
        parameters(motion_setup.parameters, motion_setup.id) {}

  /// Declares a number that requests may give. A parameter of the same name changes its default.
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
  const std::vector<MotionArgument>& arguments() const { return arguments_; }

  const MotionSetup& setup;
  const RobotSetup& robot;      ///< model, limits, workspace; outlives the motion
  const Parameters parameters;  ///< below /controller_manager/<id>

 private:
  std::vector<MotionArgument> arguments_;
};

/// Where a motion begins: the state of the set-point, which the first reference must continue.
/// Poses and velocities are those of the tool frame in the robot's base frame; velocities are per
/// second of the motion's own time.
struct SetPoint {
  JointVector joints = JointVector::Zero();          ///< rad
  JointVector joint_velocity = JointVector::Zero();  ///< rad/s
  Pose pose;
  Vector3 velocity = Vector3::Zero();          ///< m/s
  Vector3 angular_velocity = Vector3::Zero();  ///< rad/s
};

/// What start() gets.
template <typename Request = MotionArguments>
struct MotionStart {
  const Request& request;
  const SetPoint& from;
  const CycleInput& input;
};

/// What computeReference() gets. Time is the motion's own: it runs slower than the clock while
/// speed_scale or a limit slows the arm.
struct MotionCycle {
  double time = 0.0;  ///< s since the motion began
  double next = 0.0;  ///< s, the same in the next cycle
  const CycleInput& input;
  const IkResult& last;  ///< inverse kinematics of the last cycle (Cartesian references)
};

/// A motion of the arm, from its start to its end. configure() runs outside of the control cycle;
/// the others run in it and must not allocate, lock, or call the system. What they throw is caught:
/// the motion is given up, the arm brakes, the reason is published.
/// @tparam Request what a request for it says; copied in the control cycle, so of fixed size
template <typename Request = MotionArguments>
class Motion {
 public:
  virtual ~Motion() = default;

  /// Reads parameters and declares arguments. @throws std::runtime_error saying which parameter,
  /// what was expected and what came
  virtual void configure(MotionConfiguration& configuration) = 0;

  /// A motion begins in this cycle; computeReference() follows at once.
  virtual void start(const MotionStart<Request>& start) = 0;

  /// Where the arm shall be now and in the next cycle, or that it shall rest.
  virtual void computeReference(const MotionCycle& cycle, MotionReference& reference) = 0;

  /// Running or Holding while it is under way; Reached once its reference has come to its end (the
  /// runner then waits until the arm is there too); Aborted if it gives up.
  virtual MotionState state() const = 0;

  /// @name Seldom needed
  /// @{

  /// Why it holds or gives up.
  virtual const Reason& reason() const {
    static const Reason none;
    return none;
  }
  /// A limit keeps the motion from going on. Ends it as reached if the arm is at its goal.
  /// @return whether it did; if not, the motion is aborted
  virtual bool endIfThere(const CycleInput& /*input*/) { return false; }
  /// It was ended from outside: cancelled, replaced, or its controller is no longer the active one.
  virtual void stop() noexcept {}
  /// @}
};

}  // namespace coglab_controllers
