#include "coglab_controllers/motion/hold.hpp"

#include <algorithm>
#include <cmath>

#include "coglab_rt/interpolator.hpp"

namespace coglab_controllers {

namespace {
constexpr double kStill = 1e-3;     // rad/s, speed below which the arm counts as standing
constexpr double kTogether = 0.02;  // rad/s, speed below which each joint brakes alone
// Share of its initial speed at which the slowest joint and then all others brake alone. No joint
// may stop later than the slowest one.
constexpr double kSlow = 0.3;
// A joint that needs at least this share of the slowest joint's time also brakes alone.
constexpr double kAsSlow = 0.8;
// Share of its limit above which an acceleration is not neglected.
constexpr double kSpeedingUp = 0.02;
}  // namespace

PoseCorrection PoseCorrection::between(const Eigen::Matrix<double, 7, 1>& before,
                                       const Eigen::Matrix<double, 7, 1>& after) noexcept {
  PoseCorrection correction;
  if (before == after) return correction;
  correction.shift = after.head<3>() - before.head<3>();
  const Eigen::Vector4d from = before.tail<4>(), to = after.tail<4>();
  if (from != to) {
    correction.turn = (Quaternion(to.data()) * Quaternion(from.data()).conjugate()).normalized();
  }
  return correction;
}

Pose PoseCorrection::onto(const Pose& pose) const noexcept {
  if (none()) return pose;
  return {pose.position + shift, (turn * pose.orientation).normalized()};
}

Pose PoseCorrection::outOf(const Pose& pose) const noexcept {
  if (none()) return pose;
  return {pose.position - shift, (turn.conjugate() * pose.orientation).normalized()};
}

void StartBlend::advance(double dt) noexcept {
  const double left = blend_ > 0.0 ? std::exp(-dt / blend_) : 0.0;
  position_ *= left;
  rotation_ *= left;
  joints_ *= left;
}

JointVector Hold::braked(const RobotSample& robot, const coglab_rt::JointLimits& limits) noexcept {
  const auto velocity = robot.commanded_velocity.array();
  if (begins_) {
    // A joint that still accelerates must be free to reduce its acceleration.
    const auto speeding = robot.commanded_acceleration.array() * velocity.sign();
    if ((speeding > kSpeedingUp * limits.acceleration.array()).any()) return JointVector::Zero();
    begins_ = false;
    from_ = velocity;
    JointVector times;
    for (int i = 0; i < kMaxJoints; ++i) {
      times[i] = coglab_rt::planVelocity(velocity[i], robot.commanded_acceleration[i], 0.0,
                                         limits.acceleration[i], limits.jerk[i])
                     .totalTime();
    }
    const double longest = times.maxCoeff(&slowest_);
    slow_ = times.array() > kAsSlow * longest;
    share_ = 1.0;
  }
  if (std::abs(from_[slowest_]) < kTogether || share_ < kSlow) return JointVector::Zero();
  // Three cycles ahead of the slowest joint, so that the others do not stop later than it.
  const double now = std::clamp(velocity[slowest_] / from_[slowest_], 0.0, 1.0);
  const JointVector wanted = std::clamp(now - 3.0 * (share_ - now), 0.0, 1.0) * from_;
  share_ = now;
  return slow_.select(JointVector::Zero(), wanted);
}

void Hold::computeReference(const CycleInput& input, const RobotSetup& setup,
                            const PoseCorrection& correction, References& references) noexcept {
  const Chain& chain = setup.chain;
  const RobotSample& robot = input.robot;
  chain.evaluate(robot.commanded_position, commanded_);
  if (!latched_) {
    const Pose held = correction.outOf(commanded_.tool);
    pose_ << held.position, held.orientation.coeffs();
    joints_ = robot.commanded_position;
    latched_ = robot.commanded_velocity.lpNorm<Eigen::Infinity>() < kStill;
  }
  JointVector velocity = JointVector::Zero();
  if (!latched_) velocity = braked(robot, setup.limits);
  references.states.view<7>(references.pose) = pose_;
  references.states.view<6>(references.twist).setZero();
  references.states.view<kMaxJoints>(references.joint_position) = joints_;
  references.states.view<kMaxJoints>(references.joint_velocity) = velocity;
}

bool Hold::moved(const References& references) const noexcept {
  return (references.states.view<7>(references.pose).array() != pose_.array()).any() ||
         (references.states.view<6>(references.twist).array() != 0.0).any();
}

}  // namespace coglab_controllers
