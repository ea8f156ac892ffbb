#include "coglab_controllers/ik/second_task.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

// As for the translation, rad/s^2: errors below 2 a / K^2 (0.05 rad at K = 20) are not touched.
constexpr double kFeedbackDeceleration = 10.0;

double requireGain(const char* name, double gain) {
  if (std::isfinite(gain) && gain >= 0.0) return gain;
  throw std::invalid_argument(std::string(name) + ": expected a gain of at least 0 1/s, got " +
                              std::to_string(gain));
}

}  // namespace

OrientationTask::OrientationTask(double gain) : gain_(requireGain("rot_clik_gain", gain)) {}

void OrientationTask::evaluate(const ChainState& state, const JointVector&,
                               const CartesianReference& reference,
                               TaskConstraint& constraint) const noexcept {
  constraint.rows = 3;
  constraint.reject_whole = true;
  constraint.jacobian.topRows<3>() = state.jacobian.bottomRows<3>();
  const Vector3 error = rotationBetween(state.tool.orientation, reference.pose.orientation);
  const double angle = error.norm();
  const double brakeable = std::sqrt(2.0 * kFeedbackDeceleration * angle);
  const double gain = std::min(gain_, angle > 0.0 ? brakeable / angle : 1e3);
  constraint.velocity.head<3>() = reference.angular_velocity + gain * error;
}

PostureTask::PostureTask(const JointVector& posture, double gain)
    : posture_(posture), gain_(requireGain("posture gain", gain)) {
  if (!posture.allFinite())
    throw std::invalid_argument("posture: expected seven finite joint positions");
}

void PostureTask::evaluate(const ChainState&, const JointVector& q, const CartesianReference&,
                           TaskConstraint& constraint) const noexcept {
  constraint.rows = kMaxJoints;
  constraint.reject_whole = false;
  constraint.jacobian.setIdentity();
  constraint.velocity = gain_ * (posture_ - q);
}

}  // namespace coglab_controllers
