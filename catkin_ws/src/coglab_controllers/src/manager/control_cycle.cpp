#include "coglab_controllers/manager/control_cycle.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace coglab_controllers {

namespace {

constexpr double kFastest = 1000.0;  // m/s, means no limit; finite, so that it can be published

bool moving(MotionState state) {
  return state == MotionState::Running || state == MotionState::Holding;
}

/// The arm follows its set-point with a delay. Returns the position further along the motion.
JointVector furthest(const RobotSample& sample, const JointVector& velocity) {
  return (velocity.array() > 0.0)
      .select(sample.position.cwiseMax(sample.commanded_position),
              sample.position.cwiseMin(sample.commanded_position));
}

bool finite(const RobotSample& sample) {
  return sample.position.allFinite() && sample.velocity.allFinite() && sample.torque.allFinite() &&
         sample.external_torque.allFinite() && sample.tool_wrench.allFinite() &&
         sample.commanded_position.allFinite() && sample.commanded_velocity.allFinite() &&
         sample.commanded_acceleration.allFinite();
}

}  // namespace

Reason voidReason(const RequestStamp& stamp, const CycleInput& input) noexcept {
  if (stamp.cancels != input.cancels) {
    return Reason(ReasonCode::Cancelled, "cancelled before the motion began");
  }
  if (stamp.motion_epoch != input.robot.motion_epoch) {
    return Reason(
        ReasonCode::TooLate,
        "the robot stopped following motions after this request; request the motion again");
  }
  return Reason();
}

const char* nameOf(MotionState state) {
  switch (state) {
    case MotionState::Idle:
      return "idle";
    case MotionState::Running:
      return "running";
    case MotionState::Holding:
      return "holding";
    case MotionState::Reached:
      return "reached";
    case MotionState::Aborted:
      return "aborted";
  }
  return "unknown";
}

const char* nameOf(ManagerState state) {
  switch (state) {
    case ManagerState::Idle:
      return "idle";
    case ManagerState::Running:
      return "running";
    case ManagerState::Holding:
      return "holding";
    case ManagerState::Fault:
      return "fault";
  }
  return "unknown";
}

ControlCycle::ControlCycle(std::shared_ptr<const RobotSetup> robot, FeedbackStage& feedback,
                           const CycleSettings& settings)
    : robot_(std::move(robot)),
      feedback_(feedback),
      settings_(settings),
      guard_(robot_->guard, robot_->chain),
      progress_(settings.blocked_time) {
  input_.dt = settings_.cycle_time;
}

/// Runs code of a plug-in and catches its exceptions.
template <typename Call>
bool ControlCycle::guarded(const char* what, Call&& call) noexcept {
  in_plugin_.store(true, std::memory_order_relaxed);
  bool fine = true;
  try {
    call();
  } catch (const std::exception& error) {
    fine = false;
    fault(Reason(ReasonCode::ControllerFault, "controller '")
          << id_.c_str() << "' threw in " << what << ": " << error.what());
  } catch (...) {
    fine = false;
    fault(Reason(ReasonCode::ControllerFault, "controller '")
          << id_.c_str() << "' threw in " << what);
  }
  in_plugin_.store(false, std::memory_order_relaxed);
  return fine;
}

void ControlCycle::fault(const Reason& reason) noexcept {
  if (fault_) return;
  fault_ = true;
  fault_reason_ = reason;
  ++report_.faults;
  // Its state is unknown now. It is aborted, and its output is ignored from now on.
  guarded("abort", [this] { motion_->abort(fault_reason_); });
}

void ControlCycle::abortMotion(const Reason& reason) noexcept {
  if (motion_ != nullptr && !fault_) {
    guarded("abort", [this, &reason] { motion_->abort(reason); });
  }
}

void ControlCycle::adopt() noexcept {
  if (const CyclePlan* plan = plans_.take()) {
    feedback_.switchProfile();
    if (motion_ != nullptr) guarded("stop", [this] { motion_->stop(); });
    motion_ = plan->motion;
    cancel_ = plan->cancel;
    id_ = plan->id;
    fault_ = false;
    fault_reason_.clear();
    overruns_in_row_ = 0;
    cancelled_ = false;
    watched_ = -1;
    // Discard cancels from the time when it was not active.
    Reason old;
    if (cancel_ != nullptr && cancel_->take(old)) cancel_->confirm(false);
    if (motion_ != nullptr) guarded("start", [this] { motion_->start(input_); });
    plans_.acknowledge();
  }
  takeCancel();
  if (motion_ != nullptr && !fault_) guarded("adopt", [this] { motion_->adopt(input_); });
}

void ControlCycle::takeCancel() noexcept {
  if (cancel_ == nullptr) return;
  Reason reason;
  if (cancel_->take(reason)) {
    const bool given_up = motionState() == MotionState::Aborted;
    abortMotion(reason);
    cancel_->confirm(!given_up && motionState() == MotionState::Aborted);
    cancelled_ = true;
  }
  input_.cancels = cancel_->taken();
}

MotionState ControlCycle::motionState() const noexcept {
  return motion_ != nullptr && !fault_ ? motion_->state() : MotionState::Idle;
}

bool ControlCycle::usable(const RobotSample& sample, double dt) noexcept {
  input_reason_.clear();
  if (!finite(sample)) {
    input_reason_ =
        Reason(ReasonCode::StaleJointState, "the joint state holds a number that is not finite");
  } else if (!(dt > 0.0)) {
    input_reason_ =
        Reason(ReasonCode::StaleJointState, "the joint state is not newer than the last one");
  } else if (dt > settings_.sample_timeout) {
    input_reason_ = Reason(ReasonCode::StaleJointState, "no joint state for ") << dt << " s";
  }
  return input_reason_.empty();
}

void ControlCycle::watchRobot() noexcept {
  const RobotSample& sample = input_.robot;
  const bool aborted = numbers_ > 0 && sample.motion_epoch != report_.robot.motion_epoch;
  if (!aborted && input_.motion_allowed) return;
  const MotionState state = motionState();
  if (!moving(state) && !(aborted && state == MotionState::Reached)) return;
  const bool again = input_.motion_allowed;
  abortMotion(Reason(again ? ReasonCode::NotInCommandMode : codeOf(sample.block),
                     "the robot stopped the motion: ")
              << (again ? "it left command mode for a moment" : coglab_rt::describe(sample.block)));
}

void ControlCycle::watchLimits(double dt) noexcept {
  const JointVector& set_point = input_.robot.commanded_position;
  const bool under_way = moving(motionState());
  if (!under_way || motion_->motionId() != watched_) progress_.restart(set_point);
  if (!under_way) return;
  watched_ = motion_->motionId();
  limit_scale_ = std::clamp(motion_->limitScale() * report_.guard.scale, 0.0, 1.0);
  const GuardResult* const bound =
      progress_.update(dt, speedScale(), input_.time_scale, set_point, report_.guard);
  if (bound == nullptr) return;
  bool there = false;
  guarded("endIfThere", [&] { there = motion_->endIfThere(input_); });
  if (there) return;
  if (bound->reason == GuardReason::JointPosition) {
    abortMotion(Reason(ReasonCode::JointBlocked, "joint ")
                << robot_->chain.jointNames()[bound->joint].c_str()
                << " is at its stop and blocks the motion for " << settings_.blocked_time
                << " s; choose another goal or posture");
  } else {
    abortMotion(Reason(ReasonCode::WorkspaceBorder, "a border of the workspace blocks the motion (")
                << describe(bound->border) << ") for " << settings_.blocked_time
                << " s; choose another goal or way");
  }
}

bool ControlCycle::tooSlow(double taken) noexcept {
  overruns_in_row_ = taken > settings_.overrun_time ? overruns_in_row_ + 1 : 0;
  if (overruns_in_row_ > 0) ++report_.overruns;
  if (overruns_in_row_ < settings_.overruns_to_fault) return false;
  fault(Reason(ReasonCode::ControllerFault, "controller '")
        << id_.c_str() << "' was too slow " << static_cast<std::uint64_t>(overruns_in_row_)
        << " times in a row: " << taken * 1e3 << " ms, allowed " << settings_.overrun_time * 1e3
        << " ms");
  return true;
}

void ControlCycle::compute(JointVector& velocity) noexcept {
  References& references = feedback_.references();
  references.states.view<kMaxJoints>(references.joint_velocity).setZero();
  references.states.view<1>(references.speed_limit)[0] = kFastest;
  if (motion_ == nullptr || fault_) return;
  // Only the time of the motion controller itself counts. Feedback controllers between its two
  // parts have their own limits.
  const bool timed = settings_.overrun_time > 0.0;
  std::int64_t taken_ns = 0;
  const auto charged = [&](const char* what, auto&& call) {
    const std::int64_t begin = timed ? steadyNow() : 0;
    const bool fine = guarded(what, call);
    if (timed) taken_ns += steadyNow() - begin;
    return fine;
  };
  // Step 4: computeReference() of the motion controller.
  if (!charged("computeReference", [&] { motion_->computeReference(input_, references); })) return;
  // Step 5: task-stage feedback controllers.
  feedback_.run(ctrl_more::Stage::Task);
  // Step 6: resolve() of the motion controller.
  if (!charged("resolve", [&] { motion_->resolve(input_, references); })) return;
  if (timed && tooSlow(1e-9 * static_cast<double>(taken_ns))) return;
  if (!references.states.view<kMaxJoints>(references.joint_velocity).allFinite()) {
    fault(Reason(ReasonCode::ControllerFault, "controller '")
          << id_.c_str() << "' gave a velocity that is not finite");
    return;
  }
  // Step 7: joint-stage feedback controllers.
  feedback_.run(ctrl_more::Stage::Joint);
  velocity = references.states.view<kMaxJoints>(references.joint_velocity);
  speed_limit_ = std::max(0.0, references.states.view<1>(references.speed_limit)[0]);
  guard_.setSpeedLimit(speed_limit_);
}

void ControlCycle::run(const RobotSample& sample, double dt, VelocityCommand& out) noexcept {
  heartbeat_.fetch_add(1, std::memory_order_relaxed);
  const std::int64_t begin = settings_.overrun_time > 0.0 ? steadyNow() : 0;
  // Step 1: check the joint state.
  const bool fine = usable(sample, dt);
  if (fine) {
    input_.robot = sample;
    input_.dt = dt;
    // The velocity acts until the end of this cycle, so use the Jacobian at its middle.
    robot_->chain.evaluate(sample.position, sample.commanded_velocity, dt, input_.chain);
  }
  input_.motion_allowed = fine && sample.block == MotionBlock::None;
  input_.time_scale =
      governor_.update(fine ? dt : settings_.cycle_time, speedScale(), limit_scale_);
  feedback_.begin(sample.stamp_ns, input_.dt);
  JointVector velocity = JointVector::Zero();
  limit_scale_ = 1.0;
  speed_limit_ = kFastest;
  report_.guard = GuardResult();
  if (fine) {
    // Step 2: fill RobotStates.
    feedback_.fill(input_);
    watchRobot();
  }
  // Step 3: adopt the newest plan, a cancel and new motions.
  adopt();
  if (moving(motionState())) cancelled_ = false;
  input_.resting = cancelled_ || !input_.motion_allowed;
  if (fine) {
    feedback_.letGo(input_.resting);
    compute(velocity);
    // Step 8: guard.
    guard_.setInterfaceReserve(sample.stop_delay, sample.stop_rounding);
    guard_.limit(input_.chain, furthest(sample, velocity), velocity, report_.guard);
    watchLimits(dt);
    ++numbers_;
  } else {
    ++report_.stale;
  }
  feedback_.end();
  // Step 9: send the velocity and the report.
  out.velocity = fine ? report_.guard.velocity : JointVector::Zero();
  out.stamp_ns = sample.stamp_ns;
  out.motion_epoch = sample.motion_epoch;
  report_.velocity = out.velocity;
  report_.standing = fine && stands(sample, out.velocity);
  ++report_.samples;
  publish(begin);
}

bool ControlCycle::stands(const RobotSample& sample, const JointVector& velocity) noexcept {
  // The velocity of the last cycle may not have reached the set-point yet.
  const bool before = asked_still_;
  asked_still_ = velocity.isZero(0.0);
  return before && asked_still_ && sample.commanded_velocity.isZero(0.0) &&
         sample.commanded_acceleration.isZero(0.0);
}

void ControlCycle::idle(std::int64_t now_ns) noexcept {
  heartbeat_.fetch_add(1, std::memory_order_relaxed);
  const std::int64_t begin = settings_.overrun_time > 0.0 ? steadyNow() : 0;
  input_.motion_allowed = false;
  speed_limit_ = kFastest;
  input_.time_scale = governor_.rate();
  feedback_.begin(now_ns, settings_.cycle_time);
  const double silent = 1e-9 * static_cast<double>(now_ns - input_.robot.stamp_ns);
  if (numbers_ > 0 && silent > settings_.sample_timeout) {
    input_reason_ = Reason(ReasonCode::StaleJointState, "no joint state for more than ")
                    << settings_.sample_timeout << " s";
    report_.standing = false;
    if (moving(motionState()) && silent > settings_.silent_time) abortMotion(input_reason_);
  }
  adopt();
  feedback_.end();
  report_.velocity.setZero();
  publish(begin);
}

void ControlCycle::publish(std::int64_t begin_ns) noexcept {
  ++report_.cycles;
  report_.generation = plans_.generation();
  report_.active = id_;
  report_.fault = fault_;
  report_.motion = motionState();
  report_.time_scale = input_.time_scale;
  report_.speed_scale = speedScale();
  report_.robot = input_.robot;
  report_.dt = input_.dt;
  report_.state = ManagerState::Idle;
  if (fault_) {
    report_.state = ManagerState::Fault;
  } else if (report_.motion == MotionState::Running) {
    report_.state = ManagerState::Running;
  } else if (report_.motion == MotionState::Holding) {
    report_.state = ManagerState::Holding;
  }
  report_.reason.clear();
  if (fault_) {
    report_.reason = fault_reason_;
  } else if (!input_reason_.empty()) {
    report_.reason = input_reason_;
  } else if (motion_ != nullptr && !motion_->reason().empty()) {
    report_.reason = motion_->reason();
  } else if (numbers_ == 0) {
    report_.reason = Reason(ReasonCode::StaleJointState, "no joint state from the robot yet");
  } else if (input_.robot.block != MotionBlock::None) {
    report_.reason = Reason(codeOf(input_.robot.block), describe(input_.robot.block));
  } else if (report_.motion == MotionState::Running && speed_limit_ <= 0.0) {
    report_.reason =
        Reason(ReasonCode::WaitsForPerson,
               "the speed limit is 0 m/s: a manager such as SafeDistance stops the arm "
               "while a person is too near or not seen; the motion then goes on");
  }
  if (begin_ns != 0) {
    report_.duration = 1e-9 * static_cast<double>(steadyNow() - begin_ns);
    report_.longest = std::max(report_.longest, report_.duration);
  }
  reports_.write(report_);
}

}  // namespace coglab_controllers
