// The arm follows a motion from a Python process (package coglab, coglab.control) within bounds.
// Without answers the arm brakes, and the motion ends with a reason.
#include <cmath>
#include <memory>

#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_controllers/remote/bounded.hpp"
#include "coglab_controllers/remote/slot.hpp"

namespace coglab_controllers {
namespace {

/// Parameters: `max_speed`, `max_acceleration` (shares of the joints' limits), `hand_speed` (m/s),
/// `hand_acceleration` (m/s^2), `hand_turning` (rad/s), `hand_turning_acceleration` (rad/s^2),
/// `max_age` (s): largest age of an answer, after which the arm brakes; `silent_time` (s): time
/// without an answer after which the motion ends.
class RemoteMotion : public Motion<> {
 public:
  void configure(MotionConfiguration& configuration) override {
    const Parameters& parameters = configuration.parameters;
    const coglab_rt::JointLimits& limits = configuration.robot.limits;
    joints_.setBounds(parameters.number("max_speed", 0.5, 0.01, 1.0) * limits.velocity,
                      parameters.number("max_acceleration", 0.5, 0.01, 1.0) * limits.acceleration);
    const auto three = [](double value) { return Vector3::Constant(value); };
    place_.setBounds(three(parameters.number("hand_speed", 0.5, 0.01, 2.0)),
                     three(parameters.number("hand_acceleration", 2.0, 0.05, 20.0)));
    turn_.setBounds(three(parameters.number("hand_turning", 1.5, 0.01, 6.0)),
                    three(parameters.number("hand_turning_acceleration", 6.0, 0.05, 60.0)));
    max_age_ = parameters.number("max_age", 0.03, 0.001, 0.5);
    silent_time_ = parameters.number("silent_time", 0.3, 0.01, 5.0);
    slot_ = std::make_unique<RemoteSlot>(configuration.setup.id, RemoteKind::Motion);
  }

  void start(const MotionStart<>& start) override {
    const std::int64_t run = question_.run + 1;
    question_ = {};
    question_.run = run;
    question_.running = 1;
    write(question_.from_joints, start.from.joints);
    write(question_.from_joint_velocity, start.from.joint_velocity);
    writePoseTo(question_.from_pose, start.from.pose);
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(question_.from_twist) << start.from.velocity,
        start.from.angular_velocity;
    from_ = start.from;
    answer_ = {};
    answered_ = false;
    begun_ns_ = start.input.robot.stamp_ns;
    state_ = MotionState::Running;
    reason_.clear();
    if (!slot_->connected()) {
      give(Reason(ReasonCode::ControllerFault,
                  "no Python process is connected; start one: ./coglab controller run FILE"));
    }
  }

  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    take(cycle.input);
    const CycleInput& input = cycle.input;
    const std::int64_t heard = answered_ ? answer_.stamp_ns : begun_ns_;
    const double age = 1e-9 * static_cast<double>(input.robot.stamp_ns - heard);
    // Motion time stands still until the first answer, so that the motion begins at its start.
    if (!answered_) offset_ = cycle.time;
    if (state_ == MotionState::Running) judge(age);
    if (state_ == MotionState::Running) ask(cycle, age > 2.5 * input.dt);
    if (state_ == MotionState::Aborted || !answered_) return reference.rest();
    follow(cycle, age, reference);
  }

  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }
  void stop() noexcept override {
    if (question_.running == 0 || !slot_) return;
    question_.running = 0;
    slot_->ask(question_);
  }

 private:
  template <typename Vector>
  static void write(double* place, const Vector& vector) noexcept {
    Eigen::Map<Vector>{place} = vector;
  }
  static void writePoseTo(double* place, const Pose& pose) noexcept {
    Eigen::Map<Eigen::Matrix<double, 7, 1>>{place} << pose.position, pose.orientation.coeffs();
  }

  /// Uses the newest answer if it belongs to this motion and is valid.
  void take(const CycleInput& input) noexcept {
    RemoteAnswer answer;
    if (!slot_->read(answer) || answer.run != question_.run || done()) return;
    const bool stale = answer.stamp_ns < (answered_ ? answer_.stamp_ns : begun_ns_) ||
                       answer.stamp_ns > input.robot.stamp_ns;
    if (stale || !usable(answer)) {
      ++question_.refused;
      return;
    }
    if (answer.kind == static_cast<std::int64_t>(RemoteAnswerKind::GiveUp)) {
      give(Reason(ReasonCode::ControllerFault,
                  "the Python motion raised an exception; its terminal shows which"));
      return;
    }
    if (!answered_ || kind() != static_cast<RemoteAnswerKind>(answer.kind)) begin(input);
    answer_ = answer;
    answered_ = true;
  }

  /// Checks an answer: finite, of a known kind, a unit quaternion, within any reach.
  static bool usable(const RemoteAnswer& answer) noexcept {
    if (!std::isfinite(answer.time)) return false;
    for (const double value : answer.values) {
      if (!std::isfinite(value) || std::abs(value) > 1e3) return false;
    }
    switch (static_cast<RemoteAnswerKind>(answer.kind)) {
      case RemoteAnswerKind::Rest:
      case RemoteAnswerKind::Joints:
      case RemoteAnswerKind::GiveUp:
        return true;
      case RemoteAnswerKind::Pose:
        return std::abs(Eigen::Map<const Eigen::Vector4d>(answer.values + 3).norm() - 1.0) < 1e-3;
      default:
        return false;
    }
  }

  RemoteAnswerKind kind() const noexcept { return static_cast<RemoteAnswerKind>(answer_.kind); }
  bool done() const noexcept { return answered_ && answer_.done != 0; }

  /// The followers begin at the reference: the set-point of the start, or the commanded state.
  void begin(const CycleInput& input) noexcept {
    const bool first = !answered_;
    joints_.begin(input.robot.commanded_position, input.robot.commanded_velocity);
    place_.begin(first ? from_.pose.position : input.chain.tool.position, Vector3::Zero());
    turn_.begin(Vector3::Zero(), Vector3::Zero());
    base_ = first ? from_.pose.orientation : input.chain.tool.orientation;
    jumps_ = true;
  }

  void judge(double age) noexcept {
    if (done()) return;
    if (!slot_->connected()) {
      give(Reason(ReasonCode::ControllerFault,
                  "the Python process has ended or disconnected; the arm brakes"));
    } else if (age > silent_time_) {
      give(Reason(ReasonCode::ControllerFault, "the Python process sent nothing usable for ")
           << static_cast<std::uint64_t>(1e3 * age)
           << " ms (silent_time); it hangs, is stopped or is too slow. The arm brakes");
    }
  }

  void ask(const MotionCycle& cycle, bool late) noexcept {
    const CycleInput& input = cycle.input;
    if (late && answered_) ++question_.late;
    question_.stamp_ns = input.robot.stamp_ns;
    question_.written_ns = coglab_rt::steadyNow();
    ++question_.cycle;
    question_.dt = input.dt;
    question_.time = cycle.time - offset_;
    question_.next = cycle.next - offset_;
    write(question_.joints, input.robot.position);
    write(question_.joint_velocity, input.robot.velocity);
    write(question_.joint_torque, input.robot.torque);
    write(question_.external_torque, input.robot.external_torque);
    write(question_.wrench, input.robot.tool_wrench);
    writePoseTo(question_.hand, input.chain.tool);
    slot_->ask(question_);
  }

  void follow(const MotionCycle& cycle, double age, MotionReference& reference) noexcept {
    const double dt = cycle.input.dt;
    const double scale = cycle.input.time_scale;
    const bool ends = done();
    const bool brakes = kind() == RemoteAnswerKind::Rest || (!ends && age > max_age_);
    // The present reference, extrapolated because the answer belongs to an earlier time.
    const double since = ends ? 0.0 : std::max(0.0, cycle.time - offset_ - answer_.time);
    double left = 0.0;  // rad or m, distance to its end
    if (kind() == RemoteAnswerKind::Joints || kind() == RemoteAnswerKind::Rest) {
      const Eigen::Map<const JointVector> at(answer_.values);
      const Eigen::Map<const JointVector> speed(answer_.values + 7);
      JointVector velocity = speed;
      if (ends) velocity.setZero();
      if (brakes) {
        joints_.brake(dt);
      } else {
        joints_.follow(at + since * velocity, scale * velocity, dt);
      }
      reference.joints(joints_.at(), joints_.next());
      if (!brakes) left = (at - joints_.next()).norm();
      left += joints_.velocity().norm();
      joints_.advance();
    } else {
      const Eigen::Map<const Vector3> at(answer_.values), speed(answer_.values + 7);
      const Quaternion orientation =
          Quaternion(answer_.values[6], answer_.values[3], answer_.values[4], answer_.values[5])
              .normalized();
      Vector3 velocity = speed;
      Vector3 spin = Eigen::Map<const Vector3>(answer_.values + 10);
      if (ends) {
        velocity.setZero();
        spin.setZero();
      }
      // The rotation as a vector from the present orientation, which advances with each cycle.
      const Vector3 way =
          rotationBetween(base_, (expRotation(since * spin) * orientation).normalized());
      turn_.begin(Vector3::Zero(), turn_.velocity());
      if (brakes) {
        place_.brake(dt);
        turn_.brake(dt);
      } else {
        place_.follow(at + since * velocity, scale * velocity, dt);
        turn_.follow(way, scale * spin, dt);
      }
      const Quaternion next = (expRotation(turn_.next()) * base_).normalized();
      reference.pose({place_.at(), base_}, {place_.next(), next});
      if (!brakes) left = (at - place_.next()).norm() + rotationBetween(next, orientation).norm();
      left += place_.velocity().norm() + turn_.velocity().norm();
      place_.advance();
      base_ = next;
    }
    reference.jumps = jumps_;
    jumps_ = false;
    if (ends && left < 1e-3) state_ = MotionState::Reached;
  }

  void give(const Reason& why) noexcept {
    state_ = MotionState::Aborted;
    reason_ = why;
  }

  std::unique_ptr<RemoteSlot> slot_;
  double max_age_ = 0.03, silent_time_ = 0.3;

  RemoteQuestion question_{};
  RemoteAnswer answer_{};
  bool answered_ = false;  // in this motion
  bool jumps_ = false;
  std::int64_t begun_ns_ = 0;
  double offset_ = 0.0;  // s, motion time that passed before the first answer
  SetPoint from_;
  BoundedFollower<7> joints_;
  BoundedFollower<3> place_, turn_;
  Quaternion base_ = Quaternion::Identity();  // orientation of the reference
  MotionState state_ = MotionState::Idle;
  Reason reason_;
};

}  // namespace
}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION("coglab/RemoteMotion", coglab_controllers::RemoteMotion)
