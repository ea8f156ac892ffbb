/// @file
/// The interface of a motion controller plug-in (D4.10, section 3.1.2): exactly one is active, it
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

/// What the control cycle tells a motion controller, every cycle.
struct CycleInput {
  RobotSample robot;        ///< newest measurement; stamps and commanded state are the bridge's
  ChainState chain;         ///< kinematics at the measured joints
  double dt = 0.0;          ///< true time since the last cycle, s, > 0
  double time_scale = 1.0;  ///< 0..1: how fast the reference's own time runs (speed_scale, limits)
  bool motion_allowed = false;  ///< target velocities are followed now
  /// The arm is to rest: no motion is allowed, or a cancel came and no motion since. There are no
  /// corrections of feedback controllers then.
  bool resting = false;
  std::uint64_t cancels = 0;  ///< newest cancel of the active controller
};

/// Why a request is void in the cycle that takes it over: a cancel came after it, or the robot
/// stopped following motions. Empty: it may begin.
Reason voidReason(const RequestStamp& stamp, const CycleInput& input) noexcept;

/// The references of one cycle and where the motion controller finds its own in them.
/// Poses are those of the tool frame in the robot's base frame.
struct References {
  ctrl_more::ControlStates states;               ///< what feedback controllers modify
  ctrl_more::Reference<ctrl_more::Pose> pose;    ///< taskSpaceReferencePose: m, quaternion x y z w
  ctrl_more::Reference<ctrl_more::Twist> twist;  ///< taskSpaceReferenceVel: m/s, rad/s
  ctrl_more::Reference<kMaxJoints> joint_position;  ///< jointSpaceReference Position, rad
  ctrl_more::Reference<kMaxJoints> joint_velocity;  ///< jointSpaceReference Velocity, rad/s
  /// otherReference speed_limit, m/s: largest speed of hand and elbow. 1000 at the start of each
  /// cycle, which is no limit; controllers and managers may lower it. The guard keeps it.
  ctrl_more::Reference<1> speed_limit;
};

/// What a motion controller does at the moment.
enum class MotionState : std::uint8_t {
  Idle,     ///< no motion; braking to, or at, stand-still
  Running,  ///< a motion is executed
  Holding,  ///< a motion waits on its last valid goal
  Reached,  ///< the last motion came to its end
  Aborted   ///< the last motion was given up; the reason says why
};

/// idle, running, holding, reached or aborted.
const char* nameOf(MotionState state);

/// A request for a motion, see MotionHost::beginRequest().
struct MotionRequest {
  std::unique_lock<std::mutex> lock;  ///< hold it while the plan is built and offered
  RequestStamp stamp;                 ///< for the plan; the cycle judges it with voidReason()
  Answer welcome;                     ///< refused if no motion of this controller may begin now
};

/// What a plug-in may ask of the manager outside the cycle.
class MotionHost {
 public:
  virtual ~MotionHost() = default;

  /// Begins a request for a motion. Requests that end in a plan come one after another.
  virtual MotionRequest beginRequest(const std::string& controller_id) = 0;

  /// The newest measurement that the cycle has seen; sequence 0: none yet.
  virtual RobotSample robotSnapshot() const = 0;

  /// Time of the stamps in samples and goals, ns (steady clock; simulated time in lockstep).
  virtual std::int64_t now_ns() const = 0;

  /// How to wait for the cycle (for PlanExchange::setWait); empty: by sleeping.
  virtual std::function<void()> cycleWait() const = 0;

  /// The longest that a request waits for the cycle, s.
  virtual double planTimeout() const = 0;

  /// Sentence for a plan that the cycle did not adopt in time.
  virtual std::string notAdopted(PlanOutcome outcome) const = 0;
};

/// What a plug-in gets when it is loaded.
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

/// A motion controller: computes the references, alone.
///
/// Non-real-time: configure() and whatever requests a plug-in offers. Real-time (control thread,
/// between two samples): adopt(), start(), stop(), abort(), computeReference(), resolve(), state(),
/// reason(); these must not allocate, lock, or make system calls. What they throw is caught: the
/// motion is given up, the arm brakes, the reason is published.
class MotionController {
 public:
  virtual ~MotionController() = default;

  /// Reads the parameters. @throws std::runtime_error saying which parameter, what was expected and
  /// what came.
  virtual void configure(const MotionSetup& setup) = 0;

  /// Takes over requests made since the last cycle. Called every cycle while active, samples or
  /// not.
  /// @param input in cycles without a sample `robot.sequence` is that of the last one and
  /// motion_allowed is false
  virtual void adopt(const CycleInput& input) = 0;

  /// Becomes the active controller. The arm may be moving: commanded state in `input.robot`.
  virtual void start(const CycleInput& input) = 0;

  /// Is no longer the active one: ends its motion, reports unfinished requests as not executed.
  virtual void stop() = 0;

  /// Gives up the motion and what waits behind it (fall-back of the robot, hold, a limit, a
  /// cancel). The arm brakes by itself.
  virtual void abort(const Reason& reason) = 0;

  /// Step 4: computes the reference of this cycle and writes pose and twist (Cartesian motions) or
  /// joint position and velocity.
  virtual void computeReference(const CycleInput& input, References& references) = 0;

  /// Step 6: from the references, perhaps modified by feedback controllers, to joint velocities
  /// (joint_velocity of references).
  virtual void resolve(const CycleInput& input, References& references) = 0;

  /// 0..1: how much its own limits (those of the inverse kinematics) shrank the last velocity;
  /// slows the time scale.
  virtual double limitScale() const { return 1.0; }

  /// Number of the motion under way: another number is another motion.
  virtual int motionId() const { return 0; }

  /// A limit keeps the motion from going on. Ends it as reached if the arm is within its tolerance
  /// of the goal. @return whether it did; if not, abort() follows
  virtual bool endIfThere(const CycleInput& /*input*/) { return false; }

  /// Gains that may change at run time; null: none. Any thread.
  virtual Tunables* tunables() { return nullptr; }

  virtual MotionState state() const = 0;
  /// Why it aborted or holds; empty otherwise.
  virtual const Reason& reason() const = 0;
};

}  // namespace coglab_controllers
