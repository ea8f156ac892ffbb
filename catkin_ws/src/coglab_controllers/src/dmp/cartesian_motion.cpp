#include "coglab_controllers/dmp/cartesian_motion.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

// Below both (m/s and m) the set-point is set to rest at the latched goal. Far below an encoder
// step.
constexpr double kRestSpeed = 1e-4, kRestDistance = 1e-4;

// Share of the motion after which the shift of the goal by the approach decreases.
constexpr double kApproachBegins = 0.5;

// Share of the approach by which the goal is shifted back: from 1 to 0 along a minimum-jerk curve.
double drawnBack(double progress) noexcept {
  const double p = std::clamp((progress - kApproachBegins) / (1.0 - kApproachBegins), 0.0, 1.0);
  return 1.0 - p * p * p * (10.0 + p * (6.0 * p - 15.0));
}

// Parameters of a roll-out.
constexpr double kStep = 0.01;    // s of motion time; longer for long motions, so that
constexpr double kSteps = 400.0;  // a duration takes at most this many steps
constexpr double kThere =
    1e-3;  // m, distance from the goal at which the roll-out of an ended motion stops
constexpr double kLongest = 3.0;   // durations, longest roll-out
constexpr double kShortest = 2.0;  // s, shortest time limit

/// Every n-th entry, so that at most kPathPoints steps remain, and the last one.
TimedPath thinned(const TimedPath& path) {
  const std::size_t count = path.times.size();
  if (count <= kPathPoints + 1) return path;
  TimedPath kept;
  const std::size_t last = count - 1;
  for (std::size_t i = 0; i <= kPathPoints; ++i) {
    const std::size_t at = i * last / kPathPoints;
    kept.times.push_back(path.times[at]);
    kept.poses.push_back(path.poses[at]);
  }
  return kept;
}

}  // namespace

CartesianMotion::CartesianMotion(const GoalFilterParameters& filter, const MotionEndParameters& end)
    : end_(end), filter_(filter) {
  const auto require = [](const char* name, double value) {
    if (std::isfinite(value) && value > 0.0) return;
    throw std::invalid_argument(std::string(name) + ": expected a positive number, got " +
                                std::to_string(value));
  };
  require("end_phase", end.phase);
  require("end_speed", end.speed);
  require("end_turning", end.turning);
  require("end_distance", end.distance);
  require("follow_distance", end.follow_distance);
  require("follow_time", end.follow_time);
}

void CartesianMotion::start(const DmpPlan& plan, const Pose& pose, const Vector3& velocity,
                            const Vector3& angular_velocity, const Pose& goal,
                            const Vector3& approach) noexcept {
  filter_.begin(goal);
  away_ = 0.0;
  drawn_ = 1.0;
  arrival_speed_ = plan.arrival_speed;
  predicted_ = plan.predicted;
  arrival_rate_ = 1.0;
  dmp_ = plan.dmp;
  dmp_.start(pose.position, velocity, goal.position - approach, plan.ratio);
  orientation_ = pose.orientation.normalized();
  curve_.start(orientation_, angular_velocity, goal.orientation, dmp_.tau());
  curve_begin_ = 0.0;
  reference_ = {
      {pose.position, orientation_}, velocity, angular_velocity, plan.orientation_control};
  goal_ = goal.position;
  remaining_distance_ = (goal.position - pose.position).norm();
  phase_ = Phase::Running;
  event_ = Event::None;
  settled_ = false;
}

void CartesianMotion::switchTo(const DmpPlan& plan, const Pose& goal) noexcept {
  if (phase_ == Phase::Idle) return;
  dmp_.switchTo(plan.dmp, goal.position, plan.ratio);
  curve_begin_ = std::min(dmp_.progress(), 0.95);
  // The curve runs on the clock of the DMP, which may be slowed.
  const Vector3 angular_velocity =
      reference_.angular_velocity / std::max(rate_ * arrival_rate_, 0.1);
  filter_.restAt(goal.orientation);
  curve_.start(orientation_, angular_velocity, goal.orientation, (1.0 - curve_begin_) * dmp_.tau());
  reference_.orientation_control = plan.orientation_control;
  away_ = 0.0;
  phase_ = Phase::Running;
  settled_ = false;
}

/// Clock rate at which the set-point keeps its arrival speed near the goal.
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
  event_ = Event::None;
  if (phase_ == Phase::Idle || !(dt > 0.0)) return reference_;
  rate_ = rate;
  filter_.measureNoise(dt, goal);
  const Vector3 before = dmp_.state().position;
  Vector3 goal_velocity = Vector3::Zero();
  if (phase_ == Phase::Ended) {
    arrival_rate_ = arrivalRate(goal_);
  } else {
    // Eq. (1) uses g and g' at the beginning of the cycle. The filter then advances to its end.
    goal_ = filter_.enabled() ? filter_.position() : goal.position;
    goal_velocity = filter_.velocity();
    arrival_rate_ = arrivalRate(goal_);
    const double drawn = drawnBack(dmp_.progress());
    goal_ -= drawn * approach;
    goal_velocity += (drawn_ - drawn) / dt * approach;
    drawn_ = drawn;
    filter_.update(dt, goal, predicted_);
    curve_.setTarget(filter_.orientation());
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

  // Speeds per motion time: a motion that is slowed to a standstill has not ended.
  const double clock = std::max(rate * arrival_rate_, 1e-3);
  const double turning =
      reference_.orientation_control ? reference_.angular_velocity.norm() / clock : 0.0;
  event_ = watchEnd(dt, reference_.velocity.norm() / clock, turning, goal.position);
  if (phase_ == Phase::Ended && state.velocity.norm() < kRestSpeed &&
      (state.position - goal_).norm() < kRestDistance && curve_progress >= 1.0) {
    settled_ = true;
  }
  return reference_;
}

/// Latches the goal when the motion has arrived. Follows it again if it leaves its ball.
CartesianMotion::Event CartesianMotion::watchEnd(double dt, double speed, double turning,
                                                 const Vector3& received) noexcept {
  if (phase_ != Phase::Ended) {
    const DmpState& state = dmp_.state();
    if (state.phase >= end_.phase || speed >= end_.speed || turning >= end_.turning ||
        (state.position - goal_).norm() >= end_.distance ||
        (goal_ - received).norm() >= end_.follow_distance) {
      return Event::None;
    }
    away_ = 0.0;
    phase_ = Phase::Ended;
    return Event::Ended;
  }
  away_ = (received - goal_).norm() > end_.follow_distance ? away_ + dt : 0.0;
  if (away_ < end_.follow_time) return Event::None;
  away_ = 0.0;
  phase_ = Phase::Running;
  settled_ = false;
  filter_.restAt(goal_);
  filter_.restAt(orientation_);
  return Event::FollowsAgain;
}

void CartesianMotion::endAt(const Pose& pose) noexcept {
  dmp_.endAt(pose.position);
  away_ = 0.0;
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

TimedPath CartesianMotion::rollOut(const Pose& goal, double rate, const Vector3& approach) const {
  TimedPath path;
  CartesianMotion motion = *this;
  if (motion.phase() == CartesianMotion::Phase::Idle) return path;
  const double clock = std::clamp(rate, kSlowestClock, 1.0);
  const double step = std::max(kStep, motion.dmp().tau() / kSteps);
  const double dt = step / clock;
  const double longest = kLongest * motion.dmp().tau() + kShortest;
  for (double own = 0.0; own < longest; own += step) {
    path.poses.push_back(
        motion.step(dt, goal, clock, approach).pose);  // the set-point before the step
    path.times.push_back(own / clock);
    const bool ended = motion.phase() == CartesianMotion::Phase::Ended;
    if (ended && (motion.dmp().state().position - motion.goal()).norm() < kThere) break;
  }
  return thinned(path);
}

}  // namespace coglab_controllers
