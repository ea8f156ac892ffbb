#include "coglab_controllers/plugins/stream_controller.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_rt/braking.hpp"

namespace coglab_controllers {

namespace {

/// The vector, shortened to a length.
template <typename Vector>
Vector shortened(const Vector& vector, double most) {
  const double length = vector.norm();
  return length > most ? Vector(vector * (most / length)) : vector;
}

constexpr double kClocks = 0.05;  // s, largest difference of two computers' clocks

double readTimeout(const Parameters& parameters) {
  return parameters.number("command_timeout", 0.1, 0.005, 10.0);
}

/// Base of all streams: the newest command, its age, and rest without a command.
class StreamMotion : public Motion<StreamRequest> {
 public:
  StreamMailbox mailbox;

  void configure(MotionConfiguration& configuration) override {
    robot_ = configuration.setup.robot;
    const Parameters& parameters = configuration.parameters;
    declareGains(configuration);
    timeout_ns_ = static_cast<std::int64_t>(1e9 * readTimeout(parameters));
    waiting_ = Reason(ReasonCode::GoalStale, "the stream is open and has no command newer than ")
               << 1e-9 * static_cast<double>(timeout_ns_) << " s: the arm stands";
    configureStream(parameters);
  }

  void start(const MotionStart<StreamRequest>& start) override {
    opened_ns_ = start.request.opened_ns;
    resting_ = false;  // the arm may still move: continue from its state
    restart(start.from);
  }

  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    mailbox.read(newest_);
    const std::int64_t now = cycle.input.robot.stamp_ns;
    if (newest_.stamp_ns < opened_ns_ || now - newest_.stamp_ns > timeout_ns_) {
      resting_ = true;
      reference.rest();
      return;
    }
    if (resting_) restart(commanded(cycle.input));
    resting_ = false;
    follow(cycle, newest_, cycle.next - cycle.time, reference);
  }

  MotionState state() const override {
    return resting_ ? MotionState::Holding : MotionState::Running;
  }
  const Reason& reason() const override {
    static const Reason none;
    return resting_ ? waiting_ : none;
  }
  /// A limit that blocks the arm does not close the stream, because the next command may move away.
  bool endIfThere(const CycleInput&) override { return true; }

 protected:
  virtual void configureStream(const Parameters& parameters) = 0;
  /// Declares gains that may change at run time.
  virtual void declareGains(MotionConfiguration& /*configuration*/) {}
  /// The reference continues from this state.
  virtual void restart(const SetPoint& from) = 0;
  /// @param dt s of motion time until the next cycle
  virtual void follow(const MotionCycle& cycle, const StreamCommand& command, double dt,
                      MotionReference& reference) = 0;

  const Pose& commandedTool(const CycleInput& input) {
    robot_->chain.evaluate(input.robot.commanded_position, commanded_);
    return commanded_.tool;
  }

  std::shared_ptr<const RobotSetup> robot_;

 private:
  /// The commanded state of an arm that may still be braking.
  SetPoint commanded(const CycleInput& input) {
    SetPoint from;
    from.joints = input.robot.commanded_position;
    from.joint_velocity = input.robot.commanded_velocity / std::max(input.time_scale, 0.1);
    from.pose = commandedTool(input);
    const Eigen::Matrix<double, 6, 1> twist = commanded_.jacobian * from.joint_velocity;
    from.velocity = twist.head<3>();
    from.angular_velocity = twist.tail<3>();
    return from;
  }

  std::int64_t timeout_ns_ = 100'000'000, opened_ns_ = 0;
  StreamCommand newest_;
  bool resting_ = false;
  Reason waiting_;
  ChainState commanded_;  // kinematics at the commanded joints
};

/// Base for twists and poses: speeds, accelerations, and the leash to the commanded arm.
class ToolMotion : public StreamMotion {
 protected:
  void configureStream(const Parameters& parameters) override {
    max_speed_ = parameters.number("max_speed", 0.8, 0.01, 5.0);
    // Below the guard's limit, which would also slow the rotation.
    const double hand = robot_->guard.hand_speed;
    if (hand > 0.0) max_speed_ = std::min(max_speed_, 0.8 * hand);
    max_turning_ = parameters.number("max_turning", 3.0, 0.01, 20.0);
    max_acceleration_ = parameters.number("max_acceleration", 3.0, 0.1, 50.0);
    max_turning_acceleration_ = parameters.number("max_turning_acceleration", 12.0, 0.1, 200.0);
    leash_ = parameters.number("leash", 0.02, 0.001, 0.2);
  }

  void restart(const SetPoint& from) override {
    pose_ = from.pose;
    velocity_ = from.velocity;
    turning_ = from.angular_velocity;
  }

  /// Changes the velocity toward this twist in the base frame.
  void steer(const CycleInput& input, const Vector3& linear, const Vector3& angular, double dt,
             MotionReference& reference) {
    const Vector3 way = shortened(linear, max_speed_) - velocity_;
    const Vector3 turn = shortened(angular, max_turning_) - turning_;
    velocity_ += shortened(way, max_acceleration_ * dt);
    turning_ += shortened(turn, max_turning_acceleration_ * dt);
    const Pose next = leashed({pose_.position + dt * velocity_,
                               (expRotation(dt * turning_) * pose_.orientation).normalized()},
                              commandedTool(input));
    reference.pose(pose_, next);
    pose_ = next;
  }

  double max_speed_ = 0.8, max_turning_ = 3.0, max_acceleration_ = 3.0;
  double max_turning_acceleration_ = 12.0, leash_ = 0.02;
  Pose pose_;  // of the reference, now

 private:
  Pose leashed(const Pose& pose, const Pose& tool) const {
    const Vector3 turn = rotationBetween(tool.orientation, pose.orientation);
    return {tool.position + shortened(Vector3(pose.position - tool.position), leash_),
            (expRotation(shortened(turn, kTurnPerWay * leash_)) * tool.orientation).normalized()};
  }

  static constexpr double kTurnPerWay = 10.0;  // rad/m

  Vector3 velocity_ = Vector3::Zero();  // m/s of motion time
  Vector3 turning_ = Vector3::Zero();   // rad/s of motion time
};

class TwistMotion : public ToolMotion {
  void follow(const MotionCycle& cycle, const StreamCommand& command, double dt,
              MotionReference& reference) override {
    Vector3 linear = command.numbers.head<3>(), angular = command.numbers.segment<3>(3);
    if (command.in_tool) {
      linear = pose_.orientation * linear;
      angular = pose_.orientation * angular;
    }
    steer(cycle.input, linear, angular, dt, reference);
  }
};

class PoseMotion : public ToolMotion {
  void declareGains(MotionConfiguration& configuration) override {
    gain_ = &configuration.tunable("gain", "1/s, speed of the hand for the way that is left", 10.0,
                                   0.1, 50.0);
  }

  void follow(const MotionCycle& cycle, const StreamCommand& command, double dt,
              MotionReference& reference) override {
    const double gain = gain_->step(cycle.input.dt);
    const Vector3 goal = robot_->workspace.project(command.numbers.head<3>());
    const Quaternion orientation(command.numbers.tail<4>());  // x y z w
    steer(cycle.input, toward(goal - pose_.position, gain, max_acceleration_),
          toward(rotationBetween(pose_.orientation, orientation), gain, max_turning_acceleration_),
          dt, reference);
  }

  /// Velocity for a remaining way (m or rad): gain times the way, but at most the speed from which
  /// half of the acceleration stops the arm within the way.
  static Vector3 toward(const Vector3& way, double gain, double acceleration) {
    return shortened(Vector3(gain * way), std::sqrt(acceleration * way.norm()));
  }

  Tunable* gain_ = nullptr;  // 1/s
};

class JointMotion : public StreamMotion {
 protected:
  void configureStream(const Parameters& parameters) override {
    const coglab_rt::JointLimits& limits = robot_->limits;
    max_velocity_ = parameters.number("max_share", 1.0, 0.01, 1.0) * limits.velocity;
    max_acceleration_ =
        parameters.number("max_acceleration_share", 0.5, 0.01, 1.0) * limits.acceleration;
    leash_ = parameters.number("leash", 0.05, 0.001, 0.5);
  }

  void restart(const SetPoint& from) override {
    joints_ = from.joints;
    velocity_ = from.joint_velocity;
  }

  void follow(const MotionCycle& cycle, const StreamCommand& command, double dt,
              MotionReference& reference) override {
    const coglab_rt::JointLimits& limits = robot_->limits;
    const double share =
        std::max(1.0, (command.numbers.array() / max_velocity_.array()).abs().maxCoeff());
    const JointVector wanted = command.numbers / share;
    delay_ = cycle.input.robot.stop_delay + kDelay;
    JointVector next;
    for (int i = 0; i < kMaxJoints; ++i) {
      const double step = max_acceleration_[i] * dt;
      const double velocity = velocity_[i] + std::clamp(wanted[i] - velocity_[i], -step, step);
      velocity_[i] = std::clamp(velocity, -towards(joints_[i] - limits.lower_position[i], i),
                                towards(limits.upper_position[i] - joints_[i], i));
      const double commanded = cycle.input.robot.commanded_position[i];
      next[i] = std::clamp(joints_[i] + dt * velocity_[i], commanded - leash_, commanded + leash_);
    }
    reference.joints(joints_, next);
    joints_ = next;
  }

 private:
  /// Largest speed (rad/s) toward a stop at this distance (rad). The joint brakes before its
  /// margin.
  double towards(double distance, int joint) const {
    return coglab_rt::brakingSpeed(distance - robot_->limits.position_margin - kReserve,
                                   0.5 * max_acceleration_[joint], robot_->limits.jerk[joint],
                                   delay_);
  }

  // Added to the distance of the guard, which would slow all joints.
  static constexpr double kReserve = 0.01;  // rad
  static constexpr double kDelay = 0.05;    // s, added to the robot's own stop delay

  JointVector max_velocity_ = JointVector::Ones(), max_acceleration_ = JointVector::Ones();
  double leash_ = 0.05, delay_ = kDelay;
  JointVector joints_ = JointVector::Zero();    // rad, reference now
  JointVector velocity_ = JointVector::Zero();  // rad/s of motion time
};

RunnerPolicy streamPolicy(ReferenceLoop::Spaces spaces) {
  RunnerPolicy policy;
  policy.spaces = spaces;
  policy.open_end = true;
  policy.id_name = nullptr;
  policy.longest_queue = 0;
  return policy;
}

}  // namespace

StreamController::StreamController(Parts parts)
    : MotionRunner<StreamRequest>(std::move(parts.motion), streamPolicy(parts.spaces)),
      mailbox_(*parts.mailbox),
      names_(std::move(parts.names)),
      units_(std::move(parts.units)) {}

MotionAnswer StreamController::open() {
  const MotionRequest begun = setup().host->beginRequest(id());
  if (!begun.welcome.success) return MotionAnswer::rejected(begun.welcome);
  return offer(begun, {setup().host->now_ns()}, false);
}

void StreamController::configure(const MotionSetup& setup) {
  timeout_ = readTimeout(Parameters(setup.parameters, setup.id));
  MotionRunner<StreamRequest>::configure(setup);
}

Answer StreamController::send(const StreamMessage& message) {
  const std::vector<double>& numbers = message.numbers;
  if (numbers.size() != names_.size()) {
    std::string text = "a command of '" + id() + "' has " + std::to_string(numbers.size()) +
                       " numbers; expected " + std::to_string(names_.size()) + " (" + units_ +
                       "), in the order";
    for (const std::string& name : names_) text += " " + name;
    return Answer::invalid(text);
  }
  StreamCommand command;
  command.in_tool = message.in_tool;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i])) {
      return Answer::invalid(names_[i] + " of a command of '" + id() +
                             "' is not finite; expected finite numbers, " + units_);
    }
    command.numbers[static_cast<Eigen::Index>(i)] = numbers[i];
  }
  if (const std::string text = wrong(numbers); !text.empty())
    return Answer::invalid("a command of '" + id() + "' has " + text);
  if (!(message.age <= timeout_)) {
    return Answer::refusal(ReasonCode::GoalStale,
                           "a command of '" + id() + "' is " + std::to_string(message.age) +
                               " s old by its stamp; allowed: " + std::to_string(timeout_) +
                               " s (command_timeout); compare the computers' clocks");
  }
  if (message.age < -kClocks) {
    return Answer::refusal(ReasonCode::GoalFromFuture,
                           "a command of '" + id() + "' is from " + std::to_string(-message.age) +
                               " s in the future by its stamp; compare the computers' clocks");
  }
  if (!isOpen()) {
    return Answer::refusal(ReasonCode::NotActive,
                           "the stream '" + id() +
                               "' is not open; open it with start_motion, also after a cancel, a "
                               "hold or a switch");
  }
  command.stamp_ns =
      setup().host->now_ns() - static_cast<std::int64_t>(1e9 * std::max(message.age, 0.0));
  const std::lock_guard<std::mutex> lock(sending_);
  mailbox_.write(command);
  return {};
}

void StreamController::adopt(const CycleInput& input) {
  MotionRunner<StreamRequest>::adopt(input);
  open_.store(stage() != RunnerStage::Rest, std::memory_order_relaxed);
}

void StreamController::report(std::int64_t stamp_ns) {
  open_.store(stage() != RunnerStage::Rest, std::memory_order_relaxed);
  progress_.write(progress(stamp_ns));
}

namespace {

template <typename Made>
std::pair<std::unique_ptr<Made>, StreamMailbox*> make() {
  auto motion = std::make_unique<Made>();
  StreamMailbox* const mailbox = &motion->mailbox;
  return {std::move(motion), mailbox};
}

}  // namespace

TwistStream::TwistStream()
    : StreamController([] {
        auto [motion, mailbox] = make<TwistMotion>();
        return Parts{std::move(motion),
                     mailbox,
                     {"vx", "vy", "vz", "wx", "wy", "wz"},
                     "m/s and rad/s",
                     ReferenceLoop::Spaces::Pose};
      }()) {}

PoseStream::PoseStream()
    : StreamController([] {
        auto [motion, mailbox] = make<PoseMotion>();
        return Parts{std::move(motion),
                     mailbox,
                     {"x", "y", "z", "qx", "qy", "qz", "qw"},
                     "m and a unit quaternion",
                     ReferenceLoop::Spaces::Pose};
      }()) {}

std::string PoseStream::wrong(const std::vector<double>& numbers) const {
  const Quaternion orientation(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (isUnit(orientation)) return {};
  return "a quaternion of length " + std::to_string(orientation.norm()) +
         "; expected a unit quaternion qx qy qz qw, for example that of the hand now";
}

JointVelocityStream::JointVelocityStream()
    : StreamController([] {
        auto [motion, mailbox] = make<JointMotion>();
        return Parts{std::move(motion),
                     mailbox,
                     {"a1", "a2", "e1", "a3", "a4", "a5", "a6"},
                     "rad/s",
                     ReferenceLoop::Spaces::Joint};
      }()) {}

}  // namespace coglab_controllers
