#include "coglab_controllers/ik/second_task.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

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
  constraint.velocity.head<3>() = reference.angular_velocity;
  constraint.error.head<3>() = rotationBetween(state.tool.orientation, reference.pose.orientation);
  constraint.gain = gain_;
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
  constraint.velocity.setZero();
  constraint.error = posture_ - q;
  constraint.gain = gain_;
}

}  // namespace coglab_controllers
