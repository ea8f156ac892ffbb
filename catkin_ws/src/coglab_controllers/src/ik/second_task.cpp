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

AxisTask::AxisTask(const Vector3& axis, double gain)
    : axis_(axis.normalized()), gain_(requireGain("rot_clik_gain", gain)) {
  if (!axis.allFinite() || axis.norm() < 1e-6)
    throw std::invalid_argument("axis: expected three numbers that are not all zero");
}

void AxisTask::evaluate(const ChainState& state, const JointVector&,
                        const CartesianReference& reference,
                        TaskConstraint& constraint) const noexcept {
  if (!reference.orientation_control) return;
  const Vector3 now = state.tool.orientation * axis_;
  const Vector3 wanted = reference.pose.orientation * axis_;
  // Two directions perpendicular to the axis: the rotation about it is free.
  Eigen::Matrix<double, 2, 3> across;
  across.row(0) = now.unitOrthogonal().transpose();
  across.row(1) = now.cross(across.row(0).transpose()).transpose();
  const Vector3 normal = now.cross(wanted);
  const double sine = normal.norm(), angle = std::atan2(sine, now.dot(wanted));
  // Exactly opposite: every perpendicular direction is a shortest way.
  const Vector3 turn = sine > 1e-9   ? Vector3(angle / sine * normal)
                       : angle > 1.0 ? Vector3(angle * across.row(0).transpose())
                                     : normal;
  constraint.rows = 2;
  constraint.reject_whole = true;
  constraint.jacobian.topRows<2>() = across * state.jacobian.bottomRows<3>();
  constraint.velocity.head<2>() = across * reference.angular_velocity;
  constraint.error.head<2>() = across * turn;
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
