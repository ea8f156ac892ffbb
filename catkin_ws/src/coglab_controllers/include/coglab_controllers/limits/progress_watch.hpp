/// @file
/// Detects a motion that is blocked by a joint's stop or a border of the workspace.
#pragma once

#include "coglab_controllers/limits/guard.hpp"

namespace coglab_controllers {

/// Close to a stop or a border the allowed speed goes to zero smoothly, and the clock of the motion
/// with it, so no single cycle shows a blocked motion. This class measures progress over a
/// time span. No allocation, no throw.
class ProgressWatch {
 public:
  /// @param time s without progress after which a motion counts as blocked
  explicit ProgressWatch(double time) : time_(time) {}

  /// Restarts the count: a new motion begins, or none is active.
  void restart(const JointVector& set_point) noexcept {
    waited_ = own_ = 0.0;
    from_ = set_point;
    bound_ = GuardResult();
  }

  /// One cycle of a motion.
  /// @param dt s  @param speed_scale as requested; a paused motion (0) is not blocked
  /// @param time_scale rate of the motion's clock  @param set_point of the joints, rad
  /// @return the limit that blocks the motion; null if none does
  const GuardResult* update(double dt, double speed_scale, double time_scale,
                            const JointVector& set_point, const GuardResult& guard) noexcept {
    if (guard.reason == GuardReason::JointPosition || guard.reason == GuardReason::WorkspaceBorder)
      bound_ = guard;
    waited_ += dt;
    own_ += time_scale * dt;
    const bool goes_on = speed_scale <= 0.0 || own_ >= kOwnShare * speed_scale * time_ ||
                         (set_point - from_).lpNorm<Eigen::Infinity>() >= kWay;
    if (!goes_on && waited_ < time_) return nullptr;
    if (goes_on || bound_.reason == GuardReason::None) {
      restart(set_point);
      return nullptr;
    }
    return &bound_;
  }

 private:
  // Progress is this share of the time on the motion's own clock, or
  static constexpr double kOwnShare = 0.05;
  // this way of a joint, rad.
  static constexpr double kWay = 0.005;

  double time_;
  double waited_ = 0.0, own_ = 0.0;  // s
  JointVector from_ = JointVector::Zero();
  GuardResult bound_;  // the newest limit that slowed the motion meanwhile
};

}  // namespace coglab_controllers
