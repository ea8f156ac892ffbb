#include "coglab_controllers/ik/two_task_ik.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "coglab_controllers/ik/small_svd.hpp"
#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

// Share of a joint's acceleration limit that the closed loop of each task may use for braking. The
// reference and the other task need the rest.
constexpr double kBrakingShare = 0.5;

using Projector = Eigen::Matrix<double, kMaxJoints, kMaxJoints>;

// Largest |velocity| / limit over the joints.
double worstRatio(const JointVector& velocity, const JointVector& limit) noexcept {
  return (velocity.array().abs() / limit.array()).maxCoeff();
}

// Largest share a in [0, 1] of the second task with |first + a * second| inside the limits. If
// there is none, the share at which the vector exceeds them least, so that the translation is
// slowed as little as possible.
double largestShare(const JointVector& first, const JointVector& second,
                    const JointVector& limit) noexcept {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < kMaxJoints; ++i) {
    if (std::abs(second[i]) < 1e-12 * limit[i]) {
      if (std::abs(first[i]) > limit[i]) high = -1.0;
      continue;
    }
    const double a = (-limit[i] - first[i]) / second[i], b = (limit[i] - first[i]) / second[i];
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  }
  if (low <= high) return high;
  // The worst ratio is convex in a: search by thirds.
  low = 0.0;
  high = 1.0;
  for (int i = 0; i < 40; ++i) {
    const double third = (high - low) / 3.0;
    if (worstRatio(first + (low + third) * second, limit) <=
        worstRatio(first + (high - third) * second, limit)) {
      high -= third;
    } else {
      low += third;
    }
  }
  return 0.5 * (low + high);
}

// Joint velocity of the second task inside the null space of the first, eq. (11). `gain` returns
// the gain of the closed loop for the joint motion that would remove the error.
template <int Rows, typename Gain>
JointVector secondShare(const TaskConstraint& task, const JointVector& first,
                        const Projector& null_space, double threshold, Gain&& gain,
                        IkResult& result) noexcept {
  const auto jacobian = task.jacobian.topRows<Rows>();
  const RowSvd<Rows> svd((jacobian * null_space).eval());
  result.smallest_singular_value_rotation = svd.sigma.minCoeff();
  if (task.reject_whole && result.smallest_singular_value_rotation < threshold) {
    result.rotation_rejected = true;
    return JointVector::Zero();
  }
  const auto inverse = [&](double sigma) { return sigma < threshold ? 0.0 : 1.0 / sigma; };
  const Eigen::Matrix<double, kMaxJoints, Rows> pseudo_inverse = svd.pseudoInverse(inverse);
  const Eigen::Matrix<double, Rows, 1> residual = task.velocity.head<Rows>() - jacobian * first;
  const JointVector way = pseudo_inverse * task.error.head<Rows>();
  // The second projection removes the rounding error outside the null space.
  return null_space * (pseudo_inverse * residual + gain(way) * way);
}

}  // namespace

TwoTaskIk::TwoTaskIk(const IkParameters& parameters)
    : parameters_(parameters), orientation_(parameters.rot_clik_gain) {
  const auto require = [](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    throw std::invalid_argument(std::string(name) + ": expected a number from " +
                                std::to_string(low) + " to " + std::to_string(high) + ", got " +
                                std::to_string(value));
  };
  require("pos_clik_gain", parameters.pos_clik_gain, 0.0, 500.0);
  require("rot_clik_gain", parameters.rot_clik_gain, 0.0, 500.0);
  require("correction_speed", parameters.correction_speed, 1e-3,
          std::numeric_limits<double>::infinity());
  require("singularity_threshold", parameters.singularity_threshold, 1e-6, 1.0);
  require("stretch_threshold", parameters.stretch_threshold, 1e-6, 0.2);
  for (int i = 0; i < kMaxJoints; ++i) {
    const std::string index = "[" + std::to_string(i) + "]";
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    require(("velocity_limit" + index).c_str(), parameters.velocity_limit[i], 1e-3, 100.0);
    require(("acceleration_limit" + index).c_str(), parameters.acceleration_limit[i], 1e-3,
            kInfinity);
    require(("jerk_limit" + index).c_str(), parameters.jerk_limit[i], 1e-3, kInfinity);
    const double acceleration = parameters.acceleration_limit[i];
    braking_[i] = kBrakingShare * acceleration;
    // As in Guard::speedToStop(): approximate delay because of the limited jerk.
    lag_[i] = std::isfinite(acceleration)
                  ? parameters.reaction_time + 1.5 * acceleration / parameters.jerk_limit[i]
                  : 0.0;
  }
  require("reaction_time", parameters.reaction_time, 0.0, 1.0);
}

void TwoTaskIk::setGains(double position, double rotation, double correction_speed) noexcept {
  parameters_.pos_clik_gain = position;
  parameters_.rot_clik_gain = rotation;
  parameters_.correction_speed = correction_speed;
  orientation_.setGain(rotation);
}

double TwoTaskIk::brakeableGain(const JointVector& way, double gain) const noexcept {
  // v^2 / (2 a) + v * lag = way, solved for v / way = 2 / (root + lag); the slowest joint counts.
  const auto lag = lag_.array();
  const auto root = (lag.square() + 2.0 * way.array().abs() / braking_.array()).sqrt();
  const double slowest = (root + lag).maxCoeff();
  return slowest > 0.0 ? std::min(gain, 2.0 / slowest) : gain;
}

void TwoTaskIk::solve(const ChainState& state, const JointVector& q,
                      const CartesianReference& reference, IkResult& result) const noexcept {
  solve(state, q, reference, orientation_, result);
}

void TwoTaskIk::solve(const ChainState& state, const JointVector& q,
                      const CartesianReference& reference, const SecondTask& task,
                      IkResult& result) const noexcept {
  result.rotation_rejected = false;
  result.smallest_singular_value_rotation = 0.0;
  result.second_task_scale = 1.0;
  result.scale = 1.0;
  result.position_error = reference.pose.position - state.tool.position;
  result.rotation_error = rotationBetween(state.tool.orientation, reference.pose.orientation);

  const auto position_jacobian = state.jacobian.topRows<3>();  // (8)
  const RowSvd<3> svd(position_jacobian);
  result.smallest_singular_value_position = svd.sigma.minCoeff();
  const double threshold = parameters_.stretch_threshold;
  const auto damped = [&](double sigma) {
    return sigma >= threshold ? 1.0 / sigma : sigma / (threshold * threshold);
  };
  const Eigen::Matrix<double, kMaxJoints, 3> pseudo_inverse = svd.pseudoInverse(damped);
  const JointVector way = pseudo_inverse * result.position_error;
  const double error = result.position_error.norm();
  const double most =
      error > 0.0 ? parameters_.correction_speed / error : parameters_.pos_clik_gain;
  const double gain = brakeableGain(way, std::min(most, parameters_.pos_clik_gain));
  result.position_velocity = pseudo_inverse * reference.velocity + gain * way;  // (6), (9)

  // (10) from the same decomposition: J^+ J is the projection on the right singular vectors.
  Projector null_space = Projector::Identity();
  for (int i = 0; i < 3; ++i) {
    if (svd.sigma[i] < 1e-9) continue;
    const JointVector direction = svd.scaled.col(i) / svd.sigma[i];
    null_space.noalias() -= direction * direction.transpose();
  }

  const bool orientation_only = &task == &orientation_;
  TaskConstraint constraint;
  if (!orientation_only || reference.orientation_control)
    task.evaluate(state, q, reference, constraint);
  result.rotation_velocity.setZero();
  const double limit = parameters_.singularity_threshold;
  const auto task_gain = [&](const JointVector& joint_way) {
    return brakeableGain(joint_way, constraint.gain);
  };
  if (constraint.rows == 2) {
    result.rotation_velocity =
        secondShare<2>(constraint, result.position_velocity, null_space, limit, task_gain, result);
  } else if (constraint.rows == 3) {
    result.rotation_velocity =
        secondShare<3>(constraint, result.position_velocity, null_space, limit, task_gain, result);
  } else if (constraint.rows == kMaxJoints) {
    result.rotation_velocity = secondShare<kMaxJoints>(constraint, result.position_velocity,
                                                       null_space, limit, task_gain, result);
  }

  if (parameters_.rotation_first_scaling) {
    result.second_task_scale = largestShare(result.position_velocity, result.rotation_velocity,
                                            parameters_.velocity_limit);
    result.rotation_velocity *= result.second_task_scale;
  }
  result.velocity = result.position_velocity + result.rotation_velocity;  // (12)
  const double ratio = worstRatio(result.velocity, parameters_.velocity_limit);
  if (ratio > 1.0) {
    result.scale = 1.0 / ratio;
    result.velocity *= result.scale;
    result.position_velocity *= result.scale;
    result.rotation_velocity *= result.scale;
  }
}

}  // namespace coglab_controllers
