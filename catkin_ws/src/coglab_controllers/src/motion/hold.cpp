#include "coglab_controllers/motion/hold.hpp"

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

void Hold::computeReference(const CycleInput& input, const Chain& chain,
                            References& references) noexcept {
  const RobotSample& robot = input.robot;
  chain.evaluate(robot.commanded_position, commanded_);
  if (!latched_) {
    pose_ << commanded_.tool.position, commanded_.tool.orientation.coeffs();
    joints_ = robot.commanded_position;
    latched_ = robot.commanded_velocity.lpNorm<Eigen::Infinity>() < kStill;
  }
  references.states.view<7>(references.pose) = pose_;
  references.states.view<6>(references.twist).setZero();
  references.states.view<kMaxJoints>(references.joint_position) = joints_;
  references.states.view<kMaxJoints>(references.joint_velocity).setZero();
}

bool Hold::moved(const References& references) const noexcept {
  return (references.states.view<7>(references.pose).array() != pose_.array()).any() ||
         (references.states.view<6>(references.twist).array() != 0.0).any();
}

}  // namespace coglab_controllers
