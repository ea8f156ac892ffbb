/// @file
/// Compares an arm with its joint limits in each FRI period. Only the commands are differentiated,
/// and the true joints get no tolerance.
#pragma once

#include <string>

#include "coglab_rt/joint_limits.hpp"

namespace coglab_sim {

class LimitWatch {
 public:
  using Vector7 = coglab_rt::Vector7;

  /// Numbers of periods outside a limit.
  struct Outside {
    long commanded = 0;     ///< commands beyond a position, or faster than commands may be
    long measured = 0;      ///< the true joints beyond a position, or faster than the arm may be
    long over_command = 0;  ///< a true joint faster than commands may be: no violation by itself
  };

  /// `limits_file`: lwr_description/config/joint_limits.yaml or one like it. Servos pass their
  /// commanded speed by a few percent, so commands have a lower limit than the arm.
  /// @throws std::runtime_error as loadJointLimits() does.
  explicit LimitWatch(const std::string& limits_file);

  /// Checks the true joints after a period: positions (rad) and the largest speed of each in any
  /// physics step of the period (rad/s).
  void lookAtArm(const Vector7& position, const Vector7& fastest);
  /// Checks the commanded positions (rad) of a period of `period` s. `follows` false: the arm does
  /// not follow them, so their speed does not count.
  void lookAtCommand(const Vector7& position, bool follows, double period);

  const Outside& outside() const { return outside_; }
  /// Largest speed so far as share of its limit: of the commands, and of the true joints.
  double peakShare() const { return peak_share_; }
  double measuredShare() const { return measured_share_; }

 private:
  bool beyond(const Vector7& position) const;

  coglab_rt::JointLimits commands_;
  Vector7 arm_velocity_;  // rad/s
  Vector7 before_ = Vector7::Zero();
  bool knows_before_ = false;
  Outside outside_;
  double peak_share_ = 0.0, measured_share_ = 0.0;
};

}  // namespace coglab_sim
