#include "coglab_controllers/plugins/ptp_controller.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

namespace {

/// Reads seven numbers within limits; refused if something is wrong with them.
Answer readJoints(const std::vector<double>& values, const char* field,
                  const std::vector<std::string>& names, const JointVector& least,
                  const JointVector& most, const char* unit, JointVector& out) {
  std::ostringstream why;
  if (values.size() != static_cast<std::size_t>(kMaxJoints)) {
    why << field << " has " << values.size() << " numbers; expected " << kMaxJoints
        << ", in wire order lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6";
    return Answer::refusal(ReasonCode::InvalidArgument, why.str());
  }
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const double value = values[joint];
    if (!std::isfinite(value) || value < least[joint] || value > most[joint]) {
      why << field << " of " << names[joint] << " is " << value << " " << unit << "; expected "
          << least[joint] << " to " << most[joint];
      return Answer::refusal(
          std::isfinite(value) ? ReasonCode::OutOfRange : ReasonCode::InvalidArgument, why.str());
    }
    out[joint] = value;
  }
  return {};
}

}  // namespace

void PtpController::configure(const MotionSetup& setup) {
  setup_ = setup;
  if (setup.robot->chain.joints() != kMaxJoints) {
    throw std::runtime_error("the chain has not seven joints; point-to-point motions need all");
  }
  const Parameters parameters(setup.parameters, setup.id);
  const double most = std::min(100.0, largestGain(setup.cycle_time));
  gain_ = parameters.number("Kp", std::min(gain_, most), 0.0, most);
  max_queue_ = parameters.whole("max_queue", max_queue_, 0, kMaxQueue);
  tolerance_ = parameters.number("tolerance", tolerance_, 1e-5, 0.1);
  settle_time_ = parameters.number("settle_time", settle_time_, 0.0, 60.0);
  default_speed_ = parameters.number("default_speed", default_speed_, 0.01, 1.0);
  default_acceleration_ =
      parameters.number("default_acceleration", default_acceleration_, 0.01, 1.0);
  blend_.setTime(parameters.number("hold_blend", 0.15, 0.0, 5.0));
  IkParameters ik;
  ik.velocity_limit = setup.robot->limits.velocity;
  ik.acceleration_limit = setup.robot->limits.acceleration;
  ik.jerk_limit = setup.robot->limits.jerk;
  ik_ = std::make_unique<TwoTaskIk>(ik);
  if (std::function<void()> wait = setup.host->cycleWait()) plans_.setWait(wait);
}

Answer PtpController::readMotion(const PtpRequest& request, Motion& motion) const {
  const coglab_rt::JointLimits& limits = setup_.robot->limits;
  const std::vector<std::string>& names = setup_.robot->chain.jointNames();
  // The guard lets nothing beyond its margin; a target on that border would be reached only where no
  // noise of measurement crosses it.
  const JointVector margin =
      JointVector::Constant(setup_.robot->guard.position_margin + tolerance_);
  const JointVector least = JointVector::Constant(1e-4);
  motion.velocity = default_speed_ * limits.velocity;
  motion.acceleration = default_acceleration_ * limits.acceleration;
  Answer answer = readJoints(request.position, "position", names, limits.lower_position + margin,
                             limits.upper_position - margin, "rad", motion.target);
  if (answer.success && !request.max_vel.empty()) {
    answer = readJoints(request.max_vel, "max_vel", names, least, limits.velocity, "rad/s",
                        motion.velocity);
  }
  if (answer.success && !request.max_acc.empty()) {
    answer = readJoints(request.max_acc, "max_acc", names, least, limits.acceleration, "rad/s^2",
                        motion.acceleration);
  }
  if (!answer.success) return answer;
  const WorkspaceBorder border =
      setup_.robot->workspace.violated(setup_.robot->chain.evaluate(motion.target).tool.position);
  if (border == WorkspaceBorder::None) return {};
  return Answer::refusal(
      ReasonCode::GoalOutsideWorkspace,
      std::string("position puts the hand outside the workspace: ") + describe(border));
}

PtpAnswer PtpController::add(const PtpRequest& request) {
  PtpAnswer answer;
  const auto rejected = [&answer](const Answer& why) {
    answer.code = why.code;
    answer.message = why.message;
    return answer;
  };
  const MotionRequest begun = setup_.host->beginRequest(setup_.id);
  if (!begun.welcome.success) return rejected(begun.welcome);
  auto plan = std::make_unique<Plan>();
  plan->stamp = begun.stamp;
  const Answer read = readMotion(request, plan->motion);
  if (!read.success) return rejected(read);

  plan->motion.id = next_id_;
  const PlanOutcome outcome =
      plans_.offer(std::move(plan), setup_.host->planTimeout(), [&answer](const Plan& adopted) {
        answer.status = adopted.status;
        answer.code = adopted.refusal.code();
        answer.message = adopted.refusal.str();
      });
  if (outcome == PlanOutcome::Withdrawn) {
    return rejected(
        Answer::refusal(ReasonCode::NotAdopted, setup_.host->notAdopted(outcome)));
  }
  if (outcome == PlanOutcome::Taken) {
    answer.status = PtpAnswer::kQueued;
    answer.message = setup_.host->notAdopted(outcome);
  }
  if (answer.status != PtpAnswer::kRejected) answer.ptp_id = next_id_++;
  return answer;
}

// ---- the control thread
// -----------------------------------------------------------------------------------------

void PtpController::start(const CycleInput&) {
  state_ = MotionState::Idle;
  reason_.clear();
  queued_ = 0;
  pending_ = false;
  hold_.begin();
}

void PtpController::giveUp(const Reason& why) {
  int unfinished = 0;
  Reason told = why;
  const auto drop = [&](int id) {
    ends_.push({id, false, why});
    told << (unfinished++ == 0 ? "; not executed: ptp_id " : ", ")
         << static_cast<std::uint64_t>(id);
  };
  if (state_ == MotionState::Running) drop(running_.id);
  for (; queued_ > 0; --queued_) {
    drop(queue_[first_].id);
    first_ = (first_ + 1) % kMaxQueue;
  }
  pending_ = false;
  if (unfinished > 0) {
    state_ = MotionState::Aborted;
    reason_ = told;
  }
  hold_.begin();
}

void PtpController::stop() {
  giveUp(Reason(ReasonCode::Switched, "ended by a switch to another controller"));
}

void PtpController::abort(const Reason& reason) { giveUp(reason); }

void PtpController::adopt(const CycleInput& input) {
  Plan* plan = plans_.take();
  if (plan == nullptr) return;
  plan->refusal = voidReason(plan->stamp, input);
  if (!plan->refusal.empty()) {
    plan->status = PtpAnswer::kRejected;
  } else if (state_ != MotionState::Running) {
    // It begins with the next joint state: in a cycle without one, the commanded state is that of
    // the last.
    running_ = plan->motion;
    pending_ = true;
    state_ = MotionState::Running;
    reason_.clear();
    plan->status = PtpAnswer::kStarted;
  } else if (queued_ < max_queue_) {
    queue_[(first_ + queued_++) % kMaxQueue] = plan->motion;
    plan->status = PtpAnswer::kQueued;
  } else {
    plan->refusal = Reason(ReasonCode::QueueFull, "the queue is full: ")
                    << static_cast<std::uint64_t>(queued_) << " motions wait (max_queue "
                    << static_cast<std::uint64_t>(max_queue_) << "); wait for finished_ptp";
  }
  plans_.acknowledge();
}

void PtpController::begin(const CycleInput& input, const Motion& motion) {
  const RobotSample& robot = input.robot;
  const bool goes_on = !pending_;  // the next of the queue: from the last target, at rest
  pending_ = false;
  const JointVector from = goes_on ? trajectory_.target() : robot.commanded_position;
  const JointVector speed =
      goes_on ? JointVector(JointVector::Zero())
              : JointVector(robot.commanded_velocity / std::max(input.time_scale, 0.1));
  trajectory_ = PtpTrajectory(from, speed, motion.target, motion.velocity, motion.acceleration,
                              setup_.robot->chain.joints());
  if (!goes_on) blend_.begin(Vector3::Zero(), Vector3::Zero(), from - robot.position);
  running_ = motion;
  time_ = 0.0;
  settling_ = 0.0;
  state_ = MotionState::Running;
  reason_.clear();
}

void PtpController::finish(const CycleInput& input) {
  ends_.push({running_.id, true});
  if (queued_ > 0) {
    const Motion next = queue_[first_];
    first_ = (first_ + 1) % kMaxQueue;
    --queued_;
    begin(input, next);
    return;
  }
  state_ = MotionState::Reached;
  hold_.begin();
}

void PtpController::computeReference(const CycleInput& input, References& references) {
  if (pending_ && input.motion_allowed) begin(input, running_);
  if (state_ == MotionState::Running && !pending_ && time_ >= trajectory_.duration()) {
    const double error = (trajectory_.target() - input.robot.position).lpNorm<Eigen::Infinity>();
    settling_ += input.dt;
    if (error <= tolerance_) {
      finish(input);
    } else if (settling_ > settle_time_) {
      giveUp(Reason(ReasonCode::TargetNotReached,
                    "the arm does not reach the target: is it blocked?"));
    }
  }
  if (state_ != MotionState::Running || pending_) {
    hold_.computeReference(input, setup_.robot->chain, references);
    return;
  }
  // The reference of now, and the mean velocity that leads to that of the next cycle.
  trajectory_.at(time_, point_);
  const JointVector here = point_.position;
  const double step = input.dt * input.time_scale;
  time_ += step;
  trajectory_.at(time_, point_);
  references.states.view<kMaxJoints>(references.joint_position) = here;
  references.states.view<kMaxJoints>(references.joint_velocity) =
      (point_.position - here) / input.dt;
  // The pose where the tool is, for feedback controllers that look at it.
  writePose(references, input.chain.tool);
  references.states.view<6>(references.twist).setZero();
}

void PtpController::resolve(const CycleInput& input, References& references) {
  if (state_ != MotionState::Running || pending_) {
    hold_.resolve(input, references,
                  [&](const ChainState& state, const JointVector& q, const CartesianReference& to) {
                    ik_->solve(state, q, to, ik_result_);
                    return ik_result_.velocity;
                  });
    return;
  }
  const JointVector error = references.states.view<kMaxJoints>(references.joint_position) -
                            input.robot.position - blend_.joints();
  blend_.advance(input.dt);
  references.states.view<kMaxJoints>(references.joint_velocity) += gain_ * error;
}

}  // namespace coglab_controllers
