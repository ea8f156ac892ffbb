/// @file
/// Last safety limit between controller and robot. It scales the whole velocity vector and keeps
/// its direction.
#pragma once

#include <limits>

#include "coglab_controllers/limits/workspace.hpp"

namespace coglab_controllers {

/// Limits of the guard. Defaults come from coglab_rt::JointLimits.
struct GuardParameters {
  JointVector lower_position = JointVector::Constant(-2.0);  ///< rad
  JointVector upper_position = JointVector::Constant(2.0);   ///< rad, above lower_position
  JointVector velocity = JointVector::Constant(1.9);         ///< rad/s
  JointVector acceleration =
      JointVector::Constant(10.0);                  ///< rad/s^2 with which the interpolator brakes
  JointVector jerk = JointVector::Constant(500.0);  ///< rad/s^3 with which the interpolator brakes
  double position_margin = 0.01;                    ///< rad, distance kept from a joint's stop
  double hand_speed = 1.0;                          ///< m/s of the tip, what the arm behind its
                                                    ///< servos adds included; 0: no limit
  double elbow_speed = 1.0;                         ///< m/s of the elbow; 0: no limit
  double workspace_deceleration =
      2.0;  ///< m/s^2 with which a border of the workspace is approached at most
  double reaction_time = 0.015;  ///< s from a command until the arm brakes: cycle and interpolator
  WorkspaceParameters workspace;
};

/// Why a velocity was scaled.
enum class GuardReason {
  None,
  JointVelocity,  ///< `joint` is at its speed limit
  JointPosition,  ///< `joint` nears its stop
  HandSpeed,
  ElbowSpeed,
  WorkspaceBorder,  ///< `border`
  NotFinite         ///< the request was NaN or infinite: zero velocity
};
const char* describe(GuardReason reason) noexcept;

/// Result of one cycle.
struct GuardResult {
  /// rad/s: `scale` times the request; zero for a joint at its stop with a very small request
  JointVector velocity = JointVector::Zero();
  double scale = 1.0;                      ///< 0..1
  GuardReason reason = GuardReason::None;  ///< of the restriction that bound hardest
  int joint = -1;                          ///< for JointVelocity and JointPosition
  WorkspaceBorder border = WorkspaceBorder::None;
};

/// Limits joint velocities. Construction validates and may throw; `limit` neither allocates nor
/// throws.
///
/// Towards a joint's stop the bound is the speed from which the interpolator can still stop before
/// it, within its acceleration and jerk. A joint beyond its limits may only move back. If its
/// outward request is very small (1e-3 of the fastest joint's speed, or 1e-5 rad/s), only this
/// joint is stopped. A restriction that is already violated still allows motion out of it.
class Guard {
 public:
  /// @throws std::invalid_argument naming joint and parameter.
  Guard(const GuardParameters& parameters, const Chain& chain);

  /// @param state kinematics at the measured joints, from the chain given at construction.
  /// @param q rad; if measured and commanded joints differ, the ones further along the motion.
  /// @param request rad/s.
  void limit(const ChainState& state, const JointVector& q, const JointVector& request,
             GuardResult& result) const noexcept;

  /// Distance that the robot's interface keeps from joints' stops besides position_margin. With it
  /// the interface never cuts a velocity that passed here. lost_time (s, >= 0): the arm may move
  /// this long after a lost stop command; rounding of its bound (rad, >= 0). Both are 0 until set.
  void setInterfaceReserve(double lost_time, double rounding) noexcept {
    lost_time_ = lost_time;
    rounding_ = rounding;
  }

  /// Largest speed (m/s, >= 0) of hand and elbow from now on, besides hand_speed and elbow_speed;
  /// infinite: none.
  void setSpeedLimit(double limit) noexcept { speed_limit_ = limit; }

  /// Largest speed (rad/s, >= 0) of a joint `room` rad before its stop.
  double speedToStop(int joint, double room) const noexcept;

  const GuardParameters& parameters() const noexcept { return parameters_; }
  const Workspace& workspace() const noexcept { return workspace_; }

 private:
  GuardParameters parameters_;
  Chain chain_;
  Workspace workspace_;
  double lost_time_ = 0.0, rounding_ = 0.0;
  double speed_limit_ = std::numeric_limits<double>::infinity();
};

}  // namespace coglab_controllers
