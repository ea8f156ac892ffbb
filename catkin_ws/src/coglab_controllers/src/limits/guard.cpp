#include "coglab_controllers/limits/guard.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {
namespace {

// A joint at its stop is stopped alone if its outward speed is below this share of the fastest
// joint's speed, or below this speed (rad/s). The direction of the motion changes at most by the
// share.
constexpr double kNegligibleShare = 1e-3, kNegligibleSpeed = 1e-5;

// m/s, margin to a Cartesian speed limit, and the largest margin as a share of the limit. Joints
// follow their target velocities with different lags, and servos overshoot briefly.
constexpr double kSpeedMargin = 0.035, kLargestMargin = 0.15;

double bound(double speed_limit) noexcept {
  return speed_limit - std::min(kSpeedMargin, kLargestMargin * speed_limit);
}

// Speed v from which a stop within `room` is possible: v^2 / (2 a) + v * lag = room.
double stoppingSpeed(double room, double acceleration, double lag) noexcept {
  if (room <= 0.0) return 0.0;
  return acceleration * (std::sqrt(lag * lag + 2.0 * room / acceleration) - lag);
}

}  // namespace

const char* describe(GuardReason reason) noexcept {
  switch (reason) {
    case GuardReason::None:
      return "not limited";
    case GuardReason::JointVelocity:
      return "joint speed limit";
    case GuardReason::JointPosition:
      return "joint position limit";
    case GuardReason::HandSpeed:
      return "Cartesian speed limit of the hand";
    case GuardReason::ElbowSpeed:
      return "Cartesian speed limit of the elbow";
    case GuardReason::WorkspaceBorder:
      return "workspace border";
    case GuardReason::NotFinite:
      return "velocity that is not a finite number";
  }
  return "unknown";
}

Guard::Guard(const GuardParameters& parameters, const Chain& chain)
    : parameters_(parameters), chain_(chain), workspace_(parameters.workspace, chain.reach()) {
  const auto require = [](const std::string& name, double value, bool may_be_zero) {
    if (std::isfinite(value) && (value > 0.0 || (may_be_zero && value == 0.0))) return;
    throw std::invalid_argument(name + ": expected a " +
                                (may_be_zero ? "number of at least 0" : "positive number") +
                                ", got " + std::to_string(value));
  };
  const GuardParameters& p = parameters_;
  for (int i = 0; i < chain_.joints(); ++i) {
    const std::string joint = chain_.jointNames()[static_cast<std::size_t>(i)];
    if (!(p.upper_position[i] - p.lower_position[i] > 2.0 * p.position_margin)) {
      throw std::invalid_argument(
          "joint position limits of " + joint +
          ": expected the upper one above the lower one by more than twice the margin, got " +
          std::to_string(p.lower_position[i]) + " and " + std::to_string(p.upper_position[i]));
    }
    require("joint velocity limit of " + joint, p.velocity[i], false);
    require("joint acceleration limit of " + joint, p.acceleration[i], false);
    require("joint jerk limit of " + joint, p.jerk[i], false);
  }
  require("position_margin", p.position_margin, true);
  require("hand_speed", p.hand_speed, true);
  require("elbow_speed", p.elbow_speed, true);
  require("workspace_deceleration", p.workspace_deceleration, false);
  require("reaction_time", p.reaction_time, true);
}

double Guard::speedToStop(int joint, double room) const noexcept {
  const double a = parameters_.acceleration[joint];
  // Braking with limited jerk needs v a / (2 j) more distance than v^2 / (2 a). An arm that still
  // accelerates needs another a / j to reverse its acceleration. For small speeds both are on the
  // safe side.
  const double lag = 1.5 * a / parameters_.jerk[joint] + parameters_.reaction_time + lost_time_;
  return stoppingSpeed(room - parameters_.position_margin - rounding_, a, lag);
}

void Guard::limit(const ChainState& state, const JointVector& q, const JointVector& asked_for,
                  GuardResult& result) const noexcept {
  result = GuardResult{};
  const int joints = chain_.joints();
  if (!asked_for.head(joints).allFinite() || !q.head(joints).allFinite()) {
    result.scale = 0.0;
    result.reason = GuardReason::NotFinite;
    return;
  }
  const double negligible = std::max(
      kNegligibleShare * asked_for.head(joints).lpNorm<Eigen::Infinity>(), kNegligibleSpeed);
  JointVector request = asked_for;
  // `allowed` of the speed `asked`; both >= 0.
  const auto bind = [&](double asked, double allowed, GuardReason reason, int joint,
                        WorkspaceBorder border) {
    if (!(asked > allowed) || allowed / asked >= result.scale) return;
    result.scale = allowed / asked;
    result.reason = reason;
    result.joint = joint;
    result.border = border;
  };
  for (int i = 0; i < joints; ++i) {
    const double speed = std::abs(request[i]);
    bind(speed, parameters_.velocity[i], GuardReason::JointVelocity, i, WorkspaceBorder::None);
    const double room = request[i] > 0.0 ? parameters_.upper_position[i] - q[i]
                                         : q[i] - parameters_.lower_position[i];
    const double allowed = speedToStop(i, room);
    if (speed > allowed && speed <= negligible) {
      request[i] = std::copysign(allowed, request[i]);
    } else {
      bind(speed, allowed, GuardReason::JointPosition, i, WorkspaceBorder::None);
    }
  }
  // A parameter of 0 is no limit.
  const auto lower = [this](double own) {
    return own > 0.0 ? std::min(own, speed_limit_) : speed_limit_;
  };
  if (const double limit = lower(parameters_.hand_speed); std::isfinite(limit)) {
    const double speed = (state.jacobian.topRows<3>() * request).norm();
    bind(speed, bound(limit), GuardReason::HandSpeed, -1, WorkspaceBorder::None);
  }
  if (const double limit = lower(parameters_.elbow_speed); std::isfinite(limit)) {
    const double speed = Chain::originVelocity(state, chain_.elbowJoint(), request).norm();
    bind(speed, bound(limit), GuardReason::ElbowSpeed, -1, WorkspaceBorder::None);
  }
  std::array<Workspace::Margin, Workspace::kBorders> margins;
  workspace_.margins(chain_, state, request, margins);
  for (const Workspace::Margin& margin : margins) {
    // A rounding error must not stop a motion along the border.
    if (margin.rate > -1e-6) continue;
    const double allowed = stoppingSpeed(margin.distance, parameters_.workspace_deceleration,
                                         parameters_.reaction_time);
    bind(-margin.rate, allowed, GuardReason::WorkspaceBorder, -1, margin.border);
  }
  result.velocity = result.scale * request;
}

}  // namespace coglab_controllers
