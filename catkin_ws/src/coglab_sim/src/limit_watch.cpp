#include "coglab_sim/limit_watch.hpp"

#include <algorithm>

#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_sim {
namespace {
constexpr double kFloat32 = 5e-4;  // rad/s, error of a speed between two answers rounded to float32
}

LimitWatch::LimitWatch(const std::string& limits_file)
    : commands_(coglab_rt::loadJointLimits(limits_file)) {
  coglab_rt::JointLimits arm;
  const auto table = coglab_rt::detail::openLimitsTable(limits_file);
  coglab_rt::detail::readLimitProfile(limits_file, table, "default", arm);
  arm_velocity_ = arm.velocity;
}

bool LimitWatch::beyond(const Vector7& position) const {
  // Written so that a number that is not finite counts as beyond.
  return !((position.array() >= commands_.lower_position.array()).all() &&
           (position.array() <= commands_.upper_position.array()).all());
}

void LimitWatch::lookAtArm(const Vector7& position, const Vector7& fastest) {
  const double share = (fastest.array() / arm_velocity_.array()).maxCoeff();
  measured_share_ = std::max(measured_share_, share);
  outside_.measured += share > 1.0 || beyond(position);
  outside_.over_command += (fastest.array() > commands_.velocity.array()).any();
}

void LimitWatch::lookAtCommand(const Vector7& position, bool follows, double period) {
  bool outside = beyond(position);
  if (knows_before_ && follows) {
    const Vector7 speed = (position - before_).cwiseAbs() / period;
    peak_share_ = std::max(peak_share_, (speed.array() / commands_.velocity.array()).maxCoeff());
    outside = outside || (speed.array() > commands_.velocity.array() + kFloat32).any();
  }
  before_ = position;
  knows_before_ = follows;
  outside_.commanded += outside;
}

}  // namespace coglab_sim
