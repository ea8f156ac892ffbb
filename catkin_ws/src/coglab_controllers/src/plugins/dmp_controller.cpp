#include "coglab_controllers/plugins/dmp_controller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/plugins/dmp_plan.hpp"

namespace coglab_controllers {

namespace {

constexpr double kRestError =
    3e-4;  // m: after the end the loop is opened once the hand is this close,
constexpr double kRestAngle = 3e-3;  // rad, and turned this close,
constexpr double kRestTime = 0.5;    // s, or after this time, slowly:
constexpr double kFadeTime = 0.3;  // s. A hand that still turns then would leave its place if each
                                   // joint braked by itself.

Pose inverse(const Pose& pose) {
  const Quaternion back = pose.orientation.conjugate();
  return {-(back * pose.position), back};
}

Pose operator*(const Pose& a, const Pose& b) {
  return {a.position + a.orientation * b.position, (a.orientation * b.orientation).normalized()};
}

}  // namespace

DmpController::DmpController()
    : plans_(std::make_unique<PlanExchange<Plan>>()), loop_(std::make_unique<Loop>()) {}

DmpController::~DmpController() = default;

void DmpController::configure(const MotionSetup& setup) {
  setup_ = setup;
  const Parameters parameters(setup.parameters, setup.id);
  const std::string base = setup.robot->chain.baseLink();
  base_frame_ = parameters.text("robot_base_frame_name", base);
  dmp_frame_ = parameters.text("dmp_frame_name", base_frame_);
  goal_frame_ = parameters.text("goal_frame_name", "human_hand");
  goal_tf_frame_ = parameters.text("goal_tf_frame", "dmp_goal");
  goal_from_tf_ = parameters.choice("goal_source", "tf", {"tf", "topic"}) == "tf";
  setIkDebug(parameters.flag("enable_ik_debug", false));
  finish_distance_ = parameters.number("goal_finish_distance", 0.12, 0.0, 1.0);
  reach_margin_ = parameters.number("goal_reach_margin", 0.5, 0.0, 5.0);
  max_initial_distance_ = parameters.number("max_initial_distance", 0.1, 0.0, 1.0);

  IkParameters ik;
  const double most = std::min(200.0, largestGain(setup.cycle_time));
  ik.pos_clik_gain =
      parameters.number("pos_clik_gain", std::min(ik.pos_clik_gain, most), 0.0, most);
  ik.rot_clik_gain =
      parameters.number("rot_clik_gain", std::min(ik.rot_clik_gain, most), 0.0, most);
  ik.singularity_threshold =
      parameters.number("singularity_threshold", ik.singularity_threshold, 0.0, 1.0);
  ik.rotation_first_scaling = parameters.flag("rotation_first_scaling", ik.rotation_first_scaling);
  ik.velocity_limit = setup.robot->limits.velocity;
  ik.acceleration_limit = setup.robot->limits.acceleration;
  ik.jerk_limit = setup.robot->limits.jerk;
  ik_ = std::make_unique<TwoTaskIk>(ik);

  GoalGateParameters gate;
  gate.max_age = goal_from_tf_ ? parameters.number("goal_max_age", gate.max_age, 0.01, 10.0)
                               : parameters.number("goal_timeout", 0.0, 0.0, 3600.0);
  // A goal on dmp_goal is meant as it is, also when it is far from the last one.
  gate.max_jump = goal_from_tf_ ? parameters.number("goal_max_jump", gate.max_jump, 0.01, 5.0)
                                : std::numeric_limits<double>::infinity();
  gate.lost_time = parameters.number("goal_lost_time", gate.lost_time, 0.0, 60.0);

  GoalEstimatorParameters estimator;
  estimator.time_constant =
      parameters.number("goal_time_constant", estimator.time_constant, 0.0, 2.0);
  estimator.noisy_time_constant =
      parameters.number("noisy_goal_time_constant", estimator.noisy_time_constant, 0.005, 2.0);
  MotionEndParameters end;
  end.phase = parameters.number("end_phase", end.phase, 1e-6, 0.5);
  end.speed = parameters.number("end_speed", end.speed, 1e-6, 1.0);
  end.turning = parameters.number("end_turning", end.turning, 1e-6, 10.0);
  end.distance = parameters.number("end_distance", end.distance, 1e-6, 0.5);
  end.noisy_speed = parameters.number("noisy_end_speed", end.noisy_speed, 1e-6, 1.0);
  end.noisy_turning = parameters.number("noisy_end_turning", end.noisy_turning, 1e-6, 10.0);
  end.noisy_distance = parameters.number("noisy_end_distance", end.noisy_distance, 1e-6, 0.5);
  end.follow_distance = parameters.number("follow_distance", end.follow_distance, 1e-3, 1.0);
  end.follow_time = parameters.number("follow_time", end.follow_time, 0.0, 10.0);

  arrive_distance_ = parameters.number("arrive_distance", arrive_distance_, 1e-4, 0.5);
  settle_time_ = parameters.number("settle_time", settle_time_, 0.0, 60.0);

  loop_ = std::make_unique<Loop>(estimator, end, gate);
  loop_->blend.setTime(parameters.number("hold_blend", 0.15, 0.0, 5.0));
  if (std::function<void()> wait = setup.host->cycleWait()) plans_->setWait(wait);
  const std::string file = parameters.text("dmp_file", "");
  int loaded = 0;
  if (!file.empty()) {
    const Answer answer = loadDmps(file, loaded);
    if (!answer.success) throw std::runtime_error(answer.message);
  }
}

// ---- the control thread
// -----------------------------------------------------------------------------------------

void DmpController::start(const CycleInput& input) {
  loop_->motion.stop();
  loop_->pending = false;
  state_ = MotionState::Idle;
  reason_.clear();
  resting_ = true;
  hold_.begin();
  report(input);
}

void DmpController::stop() {
  loop_->motion.stop();
  loop_->pending = false;
  if (state_ == MotionState::Running || state_ == MotionState::Holding) {
    state_ = MotionState::Aborted;
    reason_ = Reason(ReasonCode::Switched, "ended by a switch to another controller");
  } else if (state_ == MotionState::Reached) {
    state_ = MotionState::Idle;
  }
  resting_ = true;
  progress_.write(loop_->progress(state_, reason_));
}

void DmpController::abort(const Reason& reason) {
  if (state_ == MotionState::Idle || state_ == MotionState::Aborted) return;
  loop_->motion.stop();
  loop_->pending = false;
  state_ = MotionState::Aborted;
  reason_ = reason;
  resting_ = true;
  hold_.begin();
}

void DmpController::adopt(const CycleInput& input) {
  Plan* const plan = plans_->take();
  if (plan == nullptr) return;
  const bool under_way = following() || state_ == MotionState::Reached;
  plan->refusal = voidReason(plan->stamp, input);
  if (plan->refusal.empty() && !plan->execute && !under_way) {
    plan->refusal = Reason(ReasonCode::NothingRuns, "no motion is running; use execute_dmp");
  }
  if (plan->refusal.empty()) {
    // It begins with the next joint state: in a cycle without one, the commanded state is that of
    // the last.
    if (!loop_->pending) loop_->was_following = following();
    loop_->pending = true;
    loop_->next = *plan;
    state_ = MotionState::Running;
    reason_.clear();
  }
  plans_->acknowledge();
}

void DmpController::begin(const CycleInput& input, const Plan& plan) {
  Loop& loop = *loop_;
  const bool was_following = loop.was_following;
  loop.pending = false;
  loop.ended = false;
  loop.base_from_dmp = plan.base_from_dmp;
  loop.dmp_from_base = inverse(plan.base_from_dmp);
  loop.primitive = plan.primitive;
  loop.plan = plan.motion;
  const Quaternion kept = loop.hand.orientation;
  loop.hand = plan.hand;

  if (!plan.execute) {
    if (plan.hand.keep_orientation) loop.hand.orientation = kept;
    const Pose goal = handGoal(loop.gate.goal(), loop.hand);
    bool projected = false;
    loop.motion.switchTo(plan.motion, inWorkspace(goal, projected));
    if (resting_) closeLoop(input);
    return;
  }

  // Where the motion begins: on the set-point of the motion it replaces, else on the commanded
  // state.
  ChainState commanded;
  setup_.robot->chain.evaluate(input.robot.commanded_position, commanded);
  Pose pose = loop.dmp_from_base * commanded.tool;
  const Eigen::Matrix<double, 6, 1> twist = commanded.jacobian * input.robot.commanded_velocity;
  const Quaternion& turn = loop.dmp_from_base.orientation;
  const double rate = std::max(input.time_scale, 0.1);
  Vector3 velocity = turn * Vector3(twist.head<3>()) / rate;
  Vector3 angular = turn * Vector3(twist.tail<3>()) / rate;
  if (was_following) {
    pose = loop.reference.pose;
    velocity = loop.motion.dmp().state().velocity;
    angular = loop.reference.angular_velocity / rate;
  }
  if (plan.given) {
    pose.position = plan.initial_position;
    velocity = plan.initial_velocity;
  }
  if (loop.hand.keep_orientation) loop.hand.orientation = pose.orientation;
  loop.request = plan.goal.request;
  loop.gate.reset(plan.goal);
  bool projected = false;
  const Pose goal = inWorkspace(handGoal(plan.goal, loop.hand), projected);
  loop.motion.start(plan.motion, pose, velocity, angular, goal);
  loop.reference.pose = pose;
  if (!was_following || plan.given) closeLoop(input);
}

void DmpController::closeLoop(const CycleInput& input) {
  Loop& loop = *loop_;
  const Pose set_point = loop.base_from_dmp * loop.reference.pose;
  loop.blend.begin(set_point.position - input.chain.tool.position,
                   rotationBetween(input.chain.tool.orientation, set_point.orientation),
                   JointVector::Zero());
  resting_ = false;
  since_end_ = 0.0;
}

Pose DmpController::handGoal(const GoalObservation& goal, const HandGoal& hand) const {
  if (!hand.in_goal_frame) return {goal.position + hand.offset, hand.orientation};
  Pose pose;
  pose.position = goal.position + goal.orientation * hand.offset;
  pose.orientation =
      hand.keep_orientation ? hand.orientation : (goal.orientation * hand.orientation).normalized();
  return pose;
}

Pose DmpController::inWorkspace(const Pose& hand_in_dmp, bool& projected) const {
  const Loop& loop = *loop_;
  const Pose hand = loop.base_from_dmp * hand_in_dmp;
  const Vector3 allowed = setup_.robot->workspace.project(hand.position);
  projected = (allowed - hand.position).squaredNorm() > 1e-12;
  if (!projected) return hand_in_dmp;
  return {(loop.dmp_from_base * Pose{allowed, hand.orientation}).position, hand_in_dmp.orientation};
}

void DmpController::watchGoal(const CycleInput& input) {
  Loop& loop = *loop_;
  GoalObservation newest;
  goals_.read(newest);
  const bool mine = newest.request == loop.request || newest.request == 0;
  const GoalGate::State gate =
      loop.gate.update(input.robot.stamp_ns, mine ? newest : loop.gate.goal());
  loop.goal = inWorkspace(handGoal(loop.gate.goal(), loop.hand), loop.projected);
  const Vector3 hand = (loop.dmp_from_base * input.chain.tool).position;
  if (state_ == MotionState::Reached || loop.ended) {
    // The motion stands at the goal it latched; newer sights differ from it by their noise.
    loop.remaining_distance = (loop.motion.goal() - hand).norm();
    return;
  }
  loop.remaining_distance = (handGoal(loop.gate.goal(), loop.hand).position - hand).norm();

  state_ = gate == GoalGate::State::Fresh ? MotionState::Running : MotionState::Holding;
  reason_.clear();
  switch (gate) {
    case GoalGate::State::Fresh:
      if (loop.projected) {
        reason_ = Reason(ReasonCode::GoalOutsideWorkspace, "the goal is outside the workspace (")
                  << describe(setup_.robot->workspace.violated(
                         (loop.base_from_dmp * handGoal(loop.gate.goal(), loop.hand)).position))
                  << "): the motion goes to the border";
      }
      break;
    case GoalGate::State::Old:
      reason_ = Reason(ReasonCode::GoalStale, "the newest goal is ")
                << loop.gate.age() << " s old: the last one is held";
      break;
    case GoalGate::State::Jumped:
      reason_ = Reason(ReasonCode::GoalJumped, "the goal jumped by ")
                << loop.gate.jump() << " m: the last one is held until frames agree";
      break;
    case GoalGate::State::Lost:
      if (loop.remaining_distance < finish_distance_) {
        reason_ = Reason(ReasonCode::GoalStale, "the goal is lost: finishing on the held one");
      } else {
        abort(Reason(ReasonCode::GoalLost, "the goal is lost for ")
              << loop.gate.age() << " s with " << loop.remaining_distance
              << " m to go; check what publishes the goal frame");
      }
      break;
  }
}

void DmpController::followEnd(const CycleInput& input) {
  Loop& loop = *loop_;
  switch (loop.motion.event()) {
    case MotionEnd::Event::Ended:
      state_ = MotionState::Running;
      reason_.clear();
      loop.ended = true;
      loop.settling = 0.0;
      break;
    case MotionEnd::Event::FollowsAgain:
      state_ = MotionState::Running;
      loop.ended = false;
      if (resting_) closeLoop(input);
      break;
    case MotionEnd::Event::None:
      break;
  }
  if (loop.ended && state_ == MotionState::Running) arrive(input.dt);
}

/// The set-point is at the goal; the motion has reached it when the hand, as measured, is too.
void DmpController::arrive(double dt) {
  Loop& loop = *loop_;
  const double away = loop.ik.position_error.norm();
  if (away <= arrive_distance_) {
    state_ = MotionState::Reached;
    reason_.clear();
    since_end_ = 0.0;
    return;
  }
  loop.settling += dt;
  if (loop.settling <= settle_time_) return;
  abort(Reason(ReasonCode::TargetNotReached, "the hand does not come to the goal: ")
        << away << " m are left; is the arm blocked?");
}

void DmpController::computeReference(const CycleInput& input, References& references) {
  Loop& loop = *loop_;
  if (loop.pending && input.motion_allowed) begin(input, loop.next);
  if (following() || state_ == MotionState::Reached) watchGoal(input);
  if (following() || state_ == MotionState::Reached) {
    loop.reference = loop.motion.step(input.dt, loop.goal, input.time_scale);
    followEnd(input);
  }
  if (following()) {
    const Quaternion& turn = loop.base_from_dmp.orientation;
    loop.in_base = loop.reference;
    loop.in_base.pose = loop.base_from_dmp * loop.reference.pose;
    loop.in_base.velocity = turn * loop.reference.velocity;
    loop.in_base.angular_velocity = turn * loop.reference.angular_velocity;
    writePose(references, loop.in_base.pose);
    references.states.view<6>(references.twist) << loop.in_base.velocity,
        loop.in_base.angular_velocity;
  } else {
    hold_.computeReference(input, setup_.robot->chain, references);
  }
}

void DmpController::resolve(const CycleInput& input, References& references) {
  Loop& loop = *loop_;
  if (!following()) {
    loop.ik.scale = 1.0;
    hold_.resolve(input, references,
                  [&](const ChainState& state, const JointVector& q, const CartesianReference& to) {
                    ik_->solve(state, q, to, loop.ik);
                    return loop.ik.velocity;
                  });
    report(input);
    return;
  }
  const auto pose = references.states.view<7>(references.pose);
  const auto twist = references.states.view<6>(references.twist);
  CartesianReference to = loop.in_base;
  to.pose.position = pose.head<3>();
  to.pose.orientation = Quaternion(pose[6], pose[3], pose[4], pose[5]);
  to.velocity = twist.head<3>();
  to.angular_velocity = twist.tail<3>();
  ChainState chain = input.chain;
  chain.tool.position += loop.blend.position();
  chain.tool.orientation = expRotation(loop.blend.rotation()) * chain.tool.orientation;
  loop.blend.advance(input.dt);
  ik_->solve(chain, input.robot.position, to, loop.ik);
  references.states.view<kMaxJoints>(references.joint_velocity) = loop.ik.velocity;

  if (state_ == MotionState::Reached) {
    since_end_ += input.dt;
    const bool there = loop.ik.position_error.norm() < kRestError &&
                       loop.ik.rotation_error.norm() < kRestAngle &&
                       loop.reference.velocity.norm() < 1e-6;
    const double left = 1.0 - (since_end_ - kRestTime) / kFadeTime;
    references.states.view<kMaxJoints>(references.joint_velocity) *= std::clamp(left, 0.0, 1.0);
    if (there || left <= 0.0) {
      resting_ = true;
      hold_.begin();
    }
  }
  report(input);
}

double DmpController::limitScale() const { return loop_->ik.scale; }

const CartesianMotion& DmpController::motion() const { return loop_->motion; }

void DmpController::report(const CycleInput& input) {
  Loop& loop = *loop_;
  loop.stamp_ns = input.robot.stamp_ns;
  progress_.write(loop.progress(state_, reason_));
  if (!ikDebug() || !following()) return;
  debug_.push(loop.debug(input.chain.tool));
}

}  // namespace coglab_controllers
