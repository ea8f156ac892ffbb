#include "coglab_controllers/plugins/dmp_cycle.hpp"

#include <algorithm>
#include <limits>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {

namespace {

// After the end the loop opens when the errors are below kRestError (m) and kRestAngle (rad), or
// after kRestTime (s). It opens slowly, in kFadeTime (s): if each joint of a turning hand braked
// alone, the hand would leave its place.
constexpr double kRestError = 3e-4;
constexpr double kRestAngle = 3e-3;
constexpr double kRestTime = 0.5;
constexpr double kFadeTime = 0.3;

Pose inverse(const Pose& pose) {
  const Quaternion back = pose.orientation.conjugate();
  return {-(back * pose.position), back};
}

Pose operator*(const Pose& a, const Pose& b) {
  return {a.position + a.orientation * b.position, (a.orientation * b.orientation).normalized()};
}

constexpr double kShortestTracking = 0.005;  // s

GoalFilterParameters readFilter(const Parameters& parameters) {
  GoalFilterParameters filter;
  filter.time_constant = parameters.number("goal_time_constant", filter.time_constant, 0.0, 2.0);
  filter.noisy_time_constant =
      parameters.number("noisy_goal_time_constant", filter.noisy_time_constant, 0.005, 2.0);
  filter.noisy_turning_time_constant = parameters.number(
      "noisy_goal_turning_time_constant", filter.noisy_turning_time_constant, 0.005, 2.0);
  filter.noisy_speed = parameters.number("noisy_goal_speed", filter.noisy_speed, 0.0, 1.0);
  filter.predicted_speed =
      parameters.number("predicted_goal_speed", filter.predicted_speed, 0.0, 1.0);
  filter.max_speed = parameters.number("goal_max_speed", filter.max_speed, 0.01, 10.0);
  filter.noisy_turning = parameters.number("noisy_goal_turning", filter.noisy_turning, 0.0, 10.0);
  return filter;
}

MotionEndParameters readEnd(const Parameters& parameters) {
  MotionEndParameters end;
  end.phase = parameters.number("end_phase", end.phase, 1e-6, 0.5);
  end.speed = parameters.number("end_speed", end.speed, 1e-6, 1.0);
  end.turning = parameters.number("end_turning", end.turning, 1e-6, 10.0);
  end.distance = parameters.number("end_distance", end.distance, 1e-6, 0.5);
  end.follow_distance = parameters.number("follow_distance", end.follow_distance, 1e-3, 1.0);
  end.follow_time = parameters.number("follow_time", end.follow_time, 1e-6, 10.0);
  return end;
}

}  // namespace

void DmpCycle::configure(MotionConfiguration& configuration) {
  const Parameters& parameters = configuration.parameters;
  robot_ = configuration.setup.robot;
  finish_distance_ = parameters.number("goal_finish_distance", finish_distance_, 0.0, 1.0);
  arrive_distance_ = parameters.number("arrive_distance", arrive_distance_, 1e-4, 0.5);
  arrival_.configure(parameters);
  frame_limits_ = readGoalLimits(parameters);
  // A goal on dmp_goal is followed even if it is far from the last one.
  topic_limits_ = frame_limits_;
  topic_limits_.max_age = parameters.number("goal_timeout", 0.0, 0.0, 3600.0);
  topic_limits_.max_jump = std::numeric_limits<double>::infinity();
  const GoalFilterParameters filter = readFilter(parameters);
  motion_ = CartesianMotion(filter, readEnd(parameters));
  if (filter.time_constant < kShortestTracking) return;  // off
  time_constant_ = &configuration.tunable("goal_time_constant",
                                          "s, time constant of the goal filter for a steady goal",
                                          filter.time_constant, kShortestTracking, 2.0);
  noisy_time_constant_ = &configuration.tunable(
      "noisy_goal_time_constant", "s, time constant of the goal filter for a noisy goal",
      filter.noisy_time_constant, kShortestTracking, 2.0);
  max_goal_speed_ =
      &configuration.tunable("goal_max_speed", "m/s, largest goal speed that the motion follows",
                             filter.max_speed, 0.01, 10.0);
}

// ---- begin and end
// -------------------------------------------------------------------------------

void DmpCycle::start(const MotionStart<DmpPlan>& start) {
  dmp_from_base_ = inverse(start.request.base_from_dmp);
  reason_.clear();
  if (start.request.execute) {
    execute(start);
  } else {
    substitute(start.request);
  }
  stage_ = DmpStage::Travel;
}

/// switch_dmp: goal, goal frame and approach stay unchanged.
void DmpCycle::substitute(const DmpPlan& plan) {
  plan_.primitive = plan.primitive;
  plan_.base_from_dmp = plan.base_from_dmp;
  plan_.offset = plan.offset;
  plan_.keep_orientation = plan.keep_orientation;
  if (!plan.keep_orientation) plan_.orientation = plan.orientation;
  bool projected = false;
  motion_.switchTo(plan, inWorkspace(plan_.handAt(limits_.goal()), projected));
}

void DmpCycle::execute(const MotionStart<DmpPlan>& start) {
  // The motion begins at the set-point of the motion that it replaces, else at the commanded state.
  plan_ = start.request;
  const Quaternion& turn = dmp_from_base_.orientation;
  Pose pose = dmp_from_base_ * start.from.pose;
  Vector3 velocity = turn * start.from.velocity;
  Vector3 angular = turn * start.from.angular_velocity;
  if (loopClosed()) {
    pose = reference_.pose;
    velocity = motion_.velocity();
    angular = reference_.angular_velocity / std::max(start.input.time_scale, 0.1);
  }
  if (plan_.given) {
    pose.position = plan_.initial_position;
    velocity = plan_.initial_velocity;
  }
  if (plan_.keep_orientation) plan_.orientation = pose.orientation;
  limits_ = GoalLimits(plan_.in_goal_frame ? frame_limits_ : topic_limits_);
  limits_.begin(plan_.goal, pose.position, plan_.goal_limits);
  goal_ = inWorkspace(plan_.handAt(plan_.goal), projected_);
  motion_.start(plan_, pose, velocity, angular, goal_, plan_.approachAt(plan_.goal));
  reference_.pose = pose;
  jumps_ = plan_.given;
}

void DmpCycle::stop() noexcept {
  motion_.stop();
  if (stage_ != DmpStage::GivenUp) stage_ = DmpStage::Rest;
}

bool DmpCycle::endIfThere(const CycleInput& input) {
  const Pose hand = dmp_from_base_ * input.chain.tool;
  if ((goal_.position - hand.position).norm() > arrive_distance_) return false;
  motion_.endAt(hand);
  stage_ = DmpStage::Watch;
  reason_.clear();
  return true;
}

void DmpCycle::giveUp(const Reason& why) noexcept {
  stage_ = DmpStage::GivenUp;
  reason_ = why;
}

MotionState DmpCycle::state() const {
  switch (stage_) {
    case DmpStage::Rest:
      return MotionState::Idle;
    case DmpStage::Travel:
      return limits_.state() == GoalLimits::State::Fresh ? MotionState::Running
                                                         : MotionState::Holding;
    case DmpStage::Arrive:
      return MotionState::Running;
    case DmpStage::Settle:
    case DmpStage::Watch:
      return MotionState::Reached;
    case DmpStage::GivenUp:
      return MotionState::Aborted;
  }
  return MotionState::Idle;
}

// ---- the goal
// ------------------------------------------------------------------------------------

Pose DmpCycle::inWorkspace(const Pose& hand_in_dmp, bool& projected) const {
  const Pose hand = plan_.base_from_dmp * hand_in_dmp;
  const Vector3 allowed = robot_->workspace.project(hand.position);
  projected = (allowed - hand.position).squaredNorm() > 1e-12;
  if (!projected) return hand_in_dmp;
  return {(dmp_from_base_ * Pose{allowed, hand.orientation}).position, hand_in_dmp.orientation};
}

void DmpCycle::watchGoal(const CycleInput& input) {
  GoalObservation newest;
  goals_.read(newest);
  const bool mine = newest.request == plan_.goal.request;
  limits_.update(input.robot.stamp_ns, mine ? newest : limits_.goal(), input.robot.controller_ns);
  const Pose wanted = plan_.handAt(limits_.goal());
  goal_ = inWorkspace(wanted, projected_);
  const Vector3 hand = (dmp_from_base_ * input.chain.tool).position;
  // After the end the motion stays at the latched goal; newer observations differ by noise.
  const bool travels = stage_ == DmpStage::Travel;
  remaining_distance_ = ((travels ? wanted.position : motion_.goal()) - hand).norm();
  const Reason away = limits_.checkBounds(input.dt);
  if (!travels) return;
  if (away.empty()) {
    judgeGoal();
  } else {
    giveUp(away);
  }
}

void DmpCycle::judgeGoal() {
  const double ahead = goals_.ahead();
  reason_.clear();
  switch (limits_.state()) {
    case GoalLimits::State::Unsettled:  // impossible here: a motion begins with a goal
    case GoalLimits::State::Fresh:
      if (projected_) {
        reason_ = Reason(ReasonCode::GoalOutsideWorkspace, "the goal is outside the workspace (")
                  << describe(robot_->workspace.violated(
                         (plan_.base_from_dmp * plan_.handAt(limits_.goal())).position))
                  << "): the motion goes to the border";
      }
      break;
    case GoalLimits::State::Old:
      reason_ = Reason(ReasonCode::GoalStale, "the newest goal is ")
                << limits_.age() << " s old: the last one is held";
      if (ahead > 0.0) {
        reason_ << "; newer ones are refused: stamped " << ahead << " s ahead of the clock";
      }
      break;
    case GoalLimits::State::Jumped:
      reason_ = Reason(ReasonCode::GoalJumped, "the goal jumped by ")
                << limits_.jump() << " m: the last one is held until frames agree";
      break;
    case GoalLimits::State::Lost:
      if (remaining_distance_ < finish_distance_) {
        reason_ = Reason(ReasonCode::GoalStale, "the goal is lost: finishing on the held one");
      } else {
        giveUp(Reason(ReasonCode::GoalLost, "the goal is lost for ")
               << limits_.age() << " s with " << remaining_distance_ << " m to go; "
               << (ahead > 0.0 ? "newer ones are stamped ahead of the clock: synchronise the clocks"
                               : "check what publishes it"));
      }
      break;
  }
}

// ---- the cycle
// -----------------------------------------------------------------------------------

void DmpCycle::computeReference(const MotionCycle& cycle, MotionReference& reference) {
  if (stage_ == DmpStage::Settle) comeToRest(cycle.last);
  watchGoal(cycle.input);
  if (stage_ == DmpStage::GivenUp) return;
  if (time_constant_ != nullptr) {
    const double dt = cycle.input.dt;
    motion_.setTracking(time_constant_->step(dt), noisy_time_constant_->step(dt),
                        max_goal_speed_->step(dt));
  }
  reference_ =
      motion_.step(cycle.input.dt, goal_, cycle.input.time_scale, plan_.approachAt(limits_.goal()));
  followEnd(cycle);
  if (loopClosed()) write(reference, cycle.input.dt);
}

/// Checks whether the hand stands at the goal, so that the loop can open.
void DmpCycle::comeToRest(const IkResult& last) {
  const bool there = last.position_error.norm() < kRestError &&
                     last.rotation_error.norm() < kRestAngle && reference_.velocity.norm() < 1e-6;
  if (there || since_reached_ >= kRestTime + kFadeTime) stage_ = DmpStage::Watch;
}

void DmpCycle::followEnd(const MotionCycle& cycle) {
  switch (motion_.event()) {
    case CartesianMotion::Event::Ended:
      stage_ = DmpStage::Arrive;
      reason_.clear();
      arrival_.begin();
      break;
    case CartesianMotion::Event::FollowsAgain:
      stage_ = DmpStage::Travel;
      break;
    case CartesianMotion::Event::None:
      break;
  }
  if (stage_ != DmpStage::Arrive) return;
  // The set-point is at the goal. The motion ends when the measured hand is there too.
  const double away = cycle.last.position_error.norm();
  switch (arrival_.update(cycle.input.dt, away, arrive_distance_)) {
    case Arrival::State::Waiting:
      break;
    case Arrival::State::There:
      stage_ = DmpStage::Settle;
      since_reached_ = 0.0;
      break;
    case Arrival::State::Stuck:
      giveUp(Arrival::handStuck(away));
      break;
  }
}

void DmpCycle::write(MotionReference& reference, double dt) {
  const Quaternion& turn = plan_.base_from_dmp.orientation;
  in_base_ = reference_;
  in_base_.pose = plan_.base_from_dmp * reference_.pose;
  in_base_.velocity = turn * reference_.velocity;
  in_base_.angular_velocity = turn * reference_.angular_velocity;
  reference.cartesian(in_base_);
  reference.jumps = jumps_;
  jumps_ = false;
  if (stage_ != DmpStage::Settle) return;
  since_reached_ += dt;
  reference.share = std::clamp(1.0 - (since_reached_ - kRestTime) / kFadeTime, 0.0, 1.0);
}

// ---- reports
// -------------------------------------------------------------------------------

DmpProgress DmpCycle::progress(std::int64_t stamp_ns, MotionState state,
                               const Reason& reason) const {
  DmpProgress now;
  now.stamp_ns = stamp_ns;
  now.primitive = plan_.primitive;
  now.state = state;
  now.reason = reason;
  now.phase = motion_.dmp().state().phase;
  now.remaining_distance = remaining_distance_;
  now.remaining_time = motion_.remainingTime();
  now.goal = {motion_.goal(), motion_.goalOrientation()};
  return now;
}

IkDebugRecord DmpCycle::debug(const CycleInput& input, const IkResult& ik) const {
  IkDebugRecord now;
  now.stamp_ns = input.robot.stamp_ns;
  now.phase = motion_.dmp().state().phase;
  now.goal = plan_.base_from_dmp.position + plan_.base_from_dmp.orientation * motion_.goal();
  now.goal_orientation = plan_.base_from_dmp.orientation * motion_.goalOrientation();
  now.set_point = in_base_.pose;
  now.velocity = in_base_.velocity;
  now.angular_velocity = in_base_.angular_velocity;
  now.measured = input.chain.tool;
  now.ik = ik;
  return now;
}

}  // namespace coglab_controllers
