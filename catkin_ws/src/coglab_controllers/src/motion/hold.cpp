#include "coglab_controllers/motion/hold.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_controllers {

namespace {
constexpr double kStill = 1e-3;  // rad/s: slower than this the arm counts as standing
}

void StartBlend::advance(double dt) noexcept {
  const double left = blend_ > 0.0 ? std::exp(-dt / blend_) : 0.0;
  position_ *= left;
  rotation_ *= left;
  joints_ *= left;
}

JointVector Hold::braked(const JointVector& velocity, const JointVector& acceleration) noexcept {
  const auto times = [&](const JointVector& of) { return of.array().abs() / acceleration.array(); };
  if (begins_) {
    begins_ = false;
    from_ = velocity;
    times(from_).maxCoeff(&slowest_);
    share_ = 1.0;
  }
  if (std::abs(from_[slowest_]) < kStill) return JointVector::Zero();
  share_ = std::clamp(velocity[slowest_] / from_[slowest_], 0.0, share_);
  JointVector wanted = share_ * from_;
  wanted[slowest_] = 0.0;
  return wanted;
}

void Hold::computeReference(const CycleInput& input, const RobotSetup& setup,
                            References& references) noexcept {
  const Chain& chain = setup.chain;
  const RobotSample& robot = input.robot;
  chain.evaluate(robot.commanded_position, commanded_);
  if (!latched_) {
    pose_ << commanded_.tool.position, commanded_.tool.orientation.coeffs();
    joints_ = robot.commanded_position;
    latched_ = robot.commanded_velocity.lpNorm<Eigen::Infinity>() < kStill;
  }
  JointVector velocity = JointVector::Zero();
  if (!latched_) velocity = braked(robot.commanded_velocity, setup.limits.acceleration);
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
