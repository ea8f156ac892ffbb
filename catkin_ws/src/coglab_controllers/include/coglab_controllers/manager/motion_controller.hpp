/// @file
/// The interface of a motion controller plug-in (D4.10, section 3.1.2). Exactly one is active and
/// writes the references.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <yaml-cpp/yaml.h>

#include "coglab_controllers/manager/motion_cancel.hpp"
#include "coglab_controllers/manager/robot_setup.hpp"
#include "coglab_controllers/manager/tunables.hpp"
#include "coglab_controllers/names.hpp"
#include "ctrl_more/states/control_states.hpp"

namespace coglab_controllers {

/// Input of a motion controller in each control cycle.
struct CycleInput {
  RobotSample robot;            ///< newest measurement; stamps and commanded state are the bridge's
  ChainState chain;             ///< kinematics at the measured joints
  double dt = 0.0;              ///< true time since the last cycle, s, > 0
  double time_scale = 1.0;      ///< 0..1, clock rate of the reference (from speed_scale and limits)
  bool motion_allowed = false;  ///< target velocities are followed now
  /// True if the arm must rest: no motion is allowed, or no motion began since a cancel. Feedback
  /// controllers then make no corrections.
  bool resting = false;
  std::uint64_t cancels = 0;  ///< newest cancel of the active controller
};

/// Reason why the cycle cannot adopt a request: a later cancel, or the robot no longer follows
/// motions. Empty: the motion may begin.
Reason voidReason(const RequestStamp& stamp, const CycleInput& input) noexcept;

/// The references of one cycle, with handles for the motion controller. Poses are those of the tool
/// frame in the robot's base frame.
struct References {
  ctrl_more::ControlStates states;               ///< modified by feedback controllers
  ctrl_more::Reference<ctrl_more::Pose> pose;    ///< taskSpaceReferencePose: m, quaternion x y z w
  ctrl_more::Reference<ctrl_more::Twist> twist;  ///< taskSpaceReferenceVel: m/s, rad/s
  ctrl_more::Reference<kMaxJoints> joint_position;  ///< jointSpaceReference Position, rad
  ctrl_more::Reference<kMaxJoints> joint_velocity;  ///< jointSpaceReference Velocity, rad/s
  /// otherReference speed_limit, m/s: largest speed of hand and elbow. It is 1000 (no limit) at the
  /// start of each cycle. Controllers and managers may lower it; the guard enforces it.
  ctrl_more::Reference<1> speed_limit;
};

/// Present activity of a motion controller.
enum class MotionState : std::uint8_t {
  Idle,     ///< no motion; the arm brakes or stands
  Running,  ///< a motion is executed
  Holding,  ///< a motion waits at its last valid goal
  Reached,  ///< the last motion reached its end
  Aborted   ///< the last motion was aborted; see reason()
};

/// Returns idle, running, holding, reached or aborted.
const char* nameOf(MotionState state);

/// A request for a motion, see MotionHost::beginRequest().
struct MotionRequest {
  std::unique_lock<std::mutex> lock;  ///< hold it while the plan is built and offered
  RequestStamp stamp;                 ///< for the plan; the cycle checks it with voidReason()
  Answer welcome;                     ///< refused if no motion of this controller may begin now
};

/// Interface of the manager to its plug-ins, outside the cycle.
class MotionHost {
 public:
  virtual ~MotionHost() = default;

  /// Begins a request for a motion. Requests that make a plan run one after another.
  virtual MotionRequest beginRequest(const std::string& controller_id) = 0;

  /// Newest measurement used by the cycle; sequence 0: none yet.
  virtual RobotSample robotSnapshot() const = 0;

  /// Time of the stamps in samples and goals, ns (steady clock; simulated time in lockstep).
  virtual std::int64_t now_ns() const = 0;

  /// Function that waits for the cycle (for PlanExchange::setWait); empty: sleep.
  virtual std::function<void()> cycleWait() const = 0;

  /// Longest wait of a request for the cycle, s.
  virtual double planTimeout() const = 0;

  /// Message for a plan that the cycle did not adopt in time.
  virtual std::string notAdopted(PlanOutcome outcome) const = 0;
};

/// Input of a plug-in when it is loaded.
struct MotionSetup {
  std::string id;             ///< the controller's id, also its namespace
  double cycle_time = 0.005;  ///< intended period of the cycle, s
  YAML::Node parameters;      ///< its parameters (ROS: below /controller_manager/<id>); may be null
  std::shared_ptr<const RobotSetup> robot;  ///< model, limits, workspace
  MotionHost* host = nullptr;               ///< outlives the controller
};

/// Largest gain (1/s) of a position loop that is closed once per cycle (s) and stays well damped
/// with the delay of the robot's interface.
inline double largestGain(double cycle_time) { return 0.5 / cycle_time; }

/// A motion controller: while it is active, only it computes the references.
///
/// Not real-time: configure() and the requests of a plug-in. Real-time (control thread, between two
/// samples): adopt(), start(), stop(), abort(), computeReference(), resolve(), state(), reason().
/// These must not allocate, lock, or make system calls. Exceptions are caught: the motion is
/// aborted, the arm brakes, and the reason is published.
class MotionController {
 public:
  virtual ~MotionController() = default;

  /// Reads the parameters. @throws std::runtime_error with the parameter, the expected and the
  /// received value.
  virtual void configure(const MotionSetup& setup) = 0;

  /// Adopts requests made since the last cycle. Called every cycle while active, with or without a
  /// sample.
  /// @param input in cycles without a sample, `robot.sequence` is that of the last sample and
  /// motion_allowed is false
  virtual void adopt(const CycleInput& input) = 0;

  /// Becomes the active controller. The arm may be moving; `input.robot` has the commanded state.
  virtual void start(const CycleInput& input) = 0;

  /// Becomes inactive: ends its motion and reports unfinished requests as not executed.
  virtual void stop() = 0;

  /// Aborts the motion and its queue (fall-back of the robot, hold, a limit, a cancel). The arm
  /// brakes without its help.
  virtual void abort(const Reason& reason) = 0;

  /// Step 4: computes the reference of this cycle and writes pose and twist (Cartesian motions) or
  /// joint position and velocity.
  virtual void computeReference(const CycleInput& input, References& references) = 0;

  /// Step 6: computes joint velocities (joint_velocity of references) from the references, which
  /// feedback controllers may have modified.
  virtual void resolve(const CycleInput& input, References& references) = 0;

  /// 0..1, scale that its own limits (of the inverse kinematics) imposed on the last velocity. It
  /// slows the time scale.
  virtual double limitScale() const { return 1.0; }

  /// Number of the running motion. Each motion has its own number.
  virtual int motionId() const { return 0; }

  /// Called if a limit blocks the motion. Ends it as reached if the arm is within its tolerance of
  /// the goal. @return true if it ended the motion; on false abort() follows
  virtual bool endIfThere(const CycleInput& /*input*/) { return false; }

  /// Gains that may change at run time; null: none. Any thread.
  virtual Tunables* tunables() { return nullptr; }

  virtual MotionState state() const = 0;
  /// Reason for Aborted or Holding; else empty.
  virtual const Reason& reason() const = 0;
};

}  // namespace coglab_controllers
