#include "coglab_controllers/dmp/cartesian_motion.hpp"

#include <algorithm>
#include <cmath>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

// Below this the set-point is put to rest at the latched goal (m/s and m); far less than an encoder
// step.
constexpr double kRestSpeed = 1e-4, kRestDistance = 1e-4;

// Share of the motion after which the goal is drawn back less and less.
constexpr double kApproachBegins = 0.5;

// Share of the approach by which the goal is drawn back: from 1 to 0 as minimum-jerk motions go.
double drawnBack(double progress) noexcept {
  const double p = std::clamp((progress - kApproachBegins) / (1.0 - kApproachBegins), 0.0, 1.0);
  return 1.0 - p * p * p * (10.0 + p * (6.0 * p - 15.0));
}

}  // namespace

CartesianMotion::CartesianMotion(const GoalEstimatorParameters& estimator,
                                 const MotionEndParameters& end)
    : goal_estimator_(estimator), orientation_estimator_(estimator), end_(end) {}

void CartesianMotion::start(const CartesianMotionPlan& plan, const Pose& pose,
                            const Vector3& velocity, const Vector3& angular_velocity,
                            const Pose& goal, const Vector3& approach) noexcept {
  goal_estimator_.reset(goal.position);
  orientation_estimator_.reset(goal.orientation);
  jitter_.reset();
  turning_jitter_.reset();
  seen_ = goal;
  end_.reset();
  drawn_ = 1.0;
  arrival_speed_ = plan.arrival_speed;
  predicted_ = plan.predicted;
  arrival_rate_ = 1.0;
  dmp_.start(plan.system, pose.position, velocity, goal.position - approach, plan.ratio);
  orientation_ = pose.orientation.normalized();
  curve_.start(orientation_, angular_velocity, goal.orientation, dmp_.tau());
  curve_begin_ = 0.0;
  reference_ = {
      {pose.position, orientation_}, velocity, angular_velocity, plan.orientation_control};
  goal_ = goal.position;
  remaining_distance_ = (goal.position - pose.position).norm();
  phase_ = Phase::Running;
  event_ = MotionEnd::Event::None;
  settled_ = false;
}

void CartesianMotion::switchTo(const CartesianMotionPlan& plan, const Pose& goal) noexcept {
  if (phase_ == Phase::Idle) return;
  dmp_.switchTo(plan.system, goal.position, plan.ratio);
  curve_begin_ = std::min(dmp_.progress(), 0.95);
  // The curve runs on the clock of the DMP, which may be slowed.
  const Vector3 angular_velocity =
      reference_.angular_velocity / std::max(rate_ * arrival_rate_, 0.1);
  orientation_estimator_.reset(goal.orientation);
  curve_.start(orientation_, angular_velocity, goal.orientation, (1.0 - curve_begin_) * dmp_.tau());
  reference_.orientation_control = plan.orientation_control;
  end_.reset();
  phase_ = Phase::Running;
  settled_ = false;
}

void CartesianMotion::watchNoise(double dt, const Pose& goal) noexcept {
  if (goal.position == seen_.position && goal.orientation.coeffs() == seen_.orientation.coeffs()) {
    jitter_.wait(dt);
    turning_jitter_.wait(dt);
    return;
  }
  jitter_.see(dt, goal.position - seen_.position);
  turning_jitter_.see(dt, rotationBetween(seen_.orientation, goal.orientation));
  seen_ = goal;
}

/// By how much the clock has to be slowed for the set-point to come to the goal no faster than it
/// may.
double CartesianMotion::arrivalRate(const Vector3& goal) const noexcept {
  if (arrival_speed_ <= 0.0) return 1.0;
  const double way = std::max(0.0, (dmp_.state().position - goal).norm() - kSlowWay);
  const double most = std::min(
      kFastestArrival, std::sqrt(arrival_speed_ * arrival_speed_ + 2.0 * kGentleBraking * way));
  const double speed = dmp_.state().velocity.norm() * rate_;
  return speed > most ? most / speed : 1.0;
}

const CartesianReference& CartesianMotion::step(double dt, const Pose& goal, double rate,
                                                const Vector3& approach) noexcept {
  event_ = MotionEnd::Event::None;
  if (phase_ == Phase::Idle || !(dt > 0.0)) return reference_;
  rate_ = rate;
  watchNoise(dt, goal);
  const Vector3 before = dmp_.state().position;
  Vector3 goal_velocity = Vector3::Zero();
  if (end_.latched()) {
    goal_ = end_.latchedGoal();
    arrival_rate_ = arrivalRate(goal_);
  } else {
    // g and g' at the beginning of the cycle go into eq. (1); the estimator then follows to its
    // end.
    goal_ = goal_estimator_.position();
    goal_velocity = goal_estimator_.velocity();
    if (!goal_estimator_.enabled()) goal_ = goal.position;
    arrival_rate_ = arrivalRate(goal_);
    const double drawn = drawnBack(dmp_.progress());
    goal_ -= drawn * approach;
    goal_velocity += (drawn_ - drawn) / dt * approach;
    drawn_ = drawn;
    goal_estimator_.update(dt, goal.position, jitter_.share(), predicted_);
    orientation_estimator_.update(dt, goal.orientation, turning_jitter_.share());
    curve_.setTarget(orientation_estimator_.orientation());
  }
  if (!settled_) dmp_.step(dt, goal_, goal_velocity, rate * arrival_rate_);
  const DmpState& state = dmp_.state();
  const double curve_progress = (dmp_.progress() - curve_begin_) / (1.0 - curve_begin_);
  const Quaternion orientation = settled_ ? orientation_ : curve_.at(curve_progress);

  reference_.pose.position = before;
  reference_.pose.orientation = orientation_;
  reference_.velocity = settled_ ? Vector3::Zero() : Vector3((state.position - before) / dt);
  reference_.angular_velocity = rotationBetween(orientation_, orientation) / dt;
  orientation_ = orientation.normalized();
  remaining_distance_ = (goal.position - state.position).norm();

  // Seen on the clock of the motion: a motion that is slowed to a standstill has not ended.
  const double clock = std::max(rate * arrival_rate_, 1e-3);
  const double turning =
      reference_.orientation_control ? reference_.angular_velocity.norm() / clock : 0.0;
  event_ = end_.update(dt, state.phase, reference_.velocity.norm() / clock, turning, state.position,
                       goal_, goal.position);
  if (event_ == MotionEnd::Event::Ended) phase_ = Phase::Ended;
  if (event_ == MotionEnd::Event::FollowsAgain) {
    phase_ = Phase::Running;
    settled_ = false;
    goal_estimator_.reset(goal_);
    orientation_estimator_.reset(orientation_);
  }
  if (phase_ == Phase::Ended && state.velocity.norm() < kRestSpeed &&
      (state.position - goal_).norm() < kRestDistance && curve_progress >= 1.0) {
    settled_ = true;
  }
  return reference_;
}

void CartesianMotion::endAt(const Pose& pose) noexcept {
  dmp_.endAt(pose.position);
  end_.latch(pose.position);
  goal_ = pose.position;
  orientation_ = pose.orientation.normalized();
  reference_.pose = {pose.position, orientation_};
  reference_.velocity.setZero();
  reference_.angular_velocity.setZero();
  drawn_ = 0.0;
  phase_ = Phase::Ended;
  settled_ = true;
}

void CartesianMotion::stop() noexcept {
  phase_ = Phase::Idle;
  reference_.pose.position = dmp_.state().position;
  reference_.pose.orientation = orientation_;
  reference_.velocity.setZero();
  reference_.angular_velocity.setZero();
}

}  // namespace coglab_controllers
