#include "coglab_contact/motion_thresholds.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace coglab_contact {
namespace {

constexpr double kRecent = 0.10;        // s, age of the newest sample of the reference mean
constexpr double kOld = 0.60;           // s, age of its oldest sample
constexpr double kLately = 0.25;        // s, age of the oldest sample of the mean for an offset
constexpr double kMemory = 0.025;       // s, averaging time of speeds and payload torque
constexpr std::size_t kLeast = 20;      // samples of the reference mean
constexpr double kLeastFelt = 0.05;     // of the largest singular value
const Vector3 kWeight(0.0, 0.0, 9.81);  // m/s^2, acceleration for carrying, base frame

}  // namespace

PalmForce explained(const Joints& torque, const Joints& deviation, const PalmJacobian& jacobian) {
  const PalmJacobian weighed = jacobian * deviation.cwiseInverse().asDiagonal();
  const Eigen::Matrix3d information = weighed * weighed.transpose();
  // A stretched arm cannot measure forces along itself: the small term keeps the solution finite.
  const Eigen::Matrix3d steadied =
      information + 1e-9 * information.trace() * Eigen::Matrix3d::Identity();
  PalmForce found;
  found.force = steadied.partialPivLu().solve(weighed * torque.cwiseQuotient(deviation));
  found.size = std::sqrt(std::max(0.0, found.force.dot(information * found.force)));
  return found;
}

Vector3 forceOnPalm(const PalmJacobian& jacobian, const Joints& torque) {
  // The singular values of J^T are the roots of the eigenvalues of J J^T.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> felt(jacobian * jacobian.transpose());
  const Vector3 along = felt.eigenvectors().transpose() * (jacobian * torque);
  const double least = kLeastFelt * kLeastFelt * felt.eigenvalues().maxCoeff();
  Vector3 share = Vector3::Zero();
  for (int i = 0; i < 3; ++i)
    if (felt.eigenvalues()[i] > least) share[i] = along[i] / felt.eigenvalues()[i];
  return felt.eigenvectors() * share;
}

Joints MotionThresholds::deviation(const Features& features) const {
  return variance.cwiseProduct(features).rowwise().sum().cwiseMax(kVarianceFloor).cwiseSqrt();
}

PalmForce MotionThresholds::force(const Change& change) const {
  return explained(change.torque, deviation(change.features), change.jacobian);
}

PalmForce MotionThresholds::steadyForce(const Offset& offset, const Features& features) const {
  const Joints moving = deviation(features);
  return explained(offset.torque, (steady.cwiseAbs2() + moving.cwiseAbs2()).cwiseSqrt(),
                   offset.jacobian);
}

void ChangeOfResidual::reset() {
  recent_.clear();
  old_.clear();
  speed_.reset();
  palm_.reset();
  stamp_ = 0.0;
  sum_.setZero();
  carried_.setZero();
}

Joints ChangeOfResidual::past() const {
  Joints sum = Joints::Zero();
  int count = 0;
  for (std::size_t i = 0; i < old_.size(); ++i) {
    if (old_[i].stamp < stamp_ - kLately) continue;
    sum += old_[i].row.head<7>();
    ++count;
  }
  return sum / count;
}

/// Low-passes the torque (Nm) that carries and accelerates the payload.
void ChangeOfResidual::carry(const Residual& residual, double load, double step, double blend,
                             const PalmJacobian& jacobian) {
  if (!(load > 0.0)) return;
  const Vector3 palm = jacobian * residual.velocity;
  Vector3 hastened = kWeight;
  if (palm_ && step > 0.0) hastened += (palm - *palm_) / step;
  const Joints needed = load * (jacobian.transpose() * hastened);
  if (palm_)
    carried_ += blend * (needed - carried_);
  else
    carried_ = needed;
  palm_ = palm;
}

std::optional<Change> ChangeOfResidual::feed(const Residual& residual, double load,
                                             const PalmJacobian& jacobian) {
  if (residual.fresh) reset();
  const double fastest = residual.velocity.cwiseAbs().maxCoeff(), speed = fastest * fastest;
  const double step = residual.stamp - stamp_;
  const double blend = speed_ ? 1.0 - std::exp(-step / kMemory) : 1.0;
  carry(residual, load, step, blend, jacobian);
  Sample now;
  now.stamp = residual.stamp;
  now.row << residual.torque, residual.rate, carried_, speed;
  recent_.push(now);
  while (!recent_.empty() && recent_.front().stamp <= residual.stamp - kRecent) {
    old_.push(recent_.front());
    sum_ += recent_.front().row;
    recent_.pop();
  }
  while (!old_.empty() && old_.front().stamp < residual.stamp - kOld) {
    sum_ -= old_.front().row;
    old_.pop();
  }
  speed_ = speed_ ? *speed_ + blend * (speed - *speed_) : speed;
  stamp_ = residual.stamp;
  if (old_.size() < kLeast) return std::nullopt;
  const Row mean = sum_ / static_cast<double>(old_.size());
  const Row change = now.row - mean;
  const double acceleration = residual.acceleration.cwiseAbs().maxCoeff();
  Change found;
  found.stamp = residual.stamp;
  found.torque = change.head<7>();
  found.rate = change.segment<7>(7);
  found.features.col(0).setOnes();
  found.features.col(1).setConstant(std::sqrt(*speed_));
  found.features.col(2).setConstant(*speed_);
  found.features.col(3).setConstant(std::max(0.0, mean[21]));
  found.features.col(4).setConstant(acceleration * acceleration);
  found.features.col(5) = change.segment<7>(14).cwiseAbs2();
  found.position = residual.position;
  found.jacobian = jacobian;
  return found;
}

}  // namespace coglab_contact
