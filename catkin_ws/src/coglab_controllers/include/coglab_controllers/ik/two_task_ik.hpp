/// @file
/// Inverse kinematics with two priorities, eq. (6)-(12).
#pragma once

#include <limits>

#include "coglab_controllers/ik/second_task.hpp"

namespace coglab_controllers {

/// Parameters of TwoTaskIk.
struct IkParameters {
  double pos_clik_gain = 20.0;  ///< K_pos, 1/s, eq. (6); at most 0.5 / cycle time for a stable loop
  double rot_clik_gain = 20.0;  ///< K_rot, 1/s, eq. (7)
  /// Largest speed that corrects a position error, m/s. For larger errors, K_pos is reduced. The
  /// default has no limit: eq. (6).
  double correction_speed = std::numeric_limits<double>::infinity();
  double singularity_threshold =
      0.05;  ///< the second task is rejected if its smallest singular value is below this
  /// Singular values of J_pos below this (m) are damped. They occur only with a stretched arm,
  /// which the workspace limits prevent. Above it, eq. (9) is the exact Moore-Penrose inverse.
  double stretch_threshold = 0.01;
  /// true: at a speed limit the second task is scaled down first, so translation keeps its
  /// priority. false: both are scaled together.
  bool rotation_first_scaling = true;
  JointVector velocity_limit = JointVector::Constant(1.9);  ///< rad/s, positive
  /// Limits of the arm, rad/s^2 and rad/s^3. A correction is only so fast that each joint can brake
  /// within the remaining error. Small errors use the full K_pos and K_rot. The default has no
  /// limits.
  JointVector acceleration_limit = JointVector::Constant(std::numeric_limits<double>::infinity());
  JointVector jerk_limit = JointVector::Constant(std::numeric_limits<double>::infinity());
  double reaction_time =
      0.015;  ///< s from a measurement until the arm follows the resulting command
};

/// Result of one cycle. It contains all values of dmp/ik_debug.
struct IkResult {
  JointVector velocity = JointVector::Zero();           ///< qd_cmd, rad/s, within the limits
  JointVector position_velocity = JointVector::Zero();  ///< share of eq. (9) in `velocity`
  JointVector rotation_velocity =
      JointVector::Zero();                   ///< share of eq. (11) in `velocity`, after scaling
  Vector3 position_error = Vector3::Zero();  ///< x_des - x_cur, m
  Vector3 rotation_error = Vector3::Zero();  ///< diff(R_des, R_cur), rad
  double smallest_singular_value_position = 0.0;  ///< of J_pos, m
  double smallest_singular_value_rotation =
      0.0;                         ///< of J_rot * N_pos; 0 if there is no second task
  double second_task_scale = 1.0;  ///< 0..1, share of the second task within the speed limits
  double scale = 1.0;  ///< 0..1, scale of the whole vector after that; <1: reference too fast
  bool rotation_rejected = false;  ///< second task dropped near a singularity
};

/// Inverse kinematics: translation first, then a second task in its null space. `solve` neither
/// allocates nor throws.
class TwoTaskIk {
 public:
  /// @throws std::invalid_argument naming the parameter.
  explicit TwoTaskIk(const IkParameters& parameters = {});

  /// Solves with the hand's orientation as second task.
  void solve(const ChainState& state, const JointVector& q, const CartesianReference& reference,
             IkResult& result) const noexcept;
  /// Solves with any second task; that task interprets reference.orientation_control.
  void solve(const ChainState& state, const JointVector& q, const CartesianReference& reference,
             const SecondTask& task, IkResult& result) const noexcept;

  /// Changes K_pos, K_rot (1/s) and the correction speed (m/s), between two cycles. The values must
  /// be within the ranges of the constructor.
  void setGains(double position, double rotation, double correction_speed) noexcept;

  const IkParameters& parameters() const noexcept { return parameters_; }

 private:
  double brakeableGain(const JointVector& way, double gain) const noexcept;

  IkParameters parameters_;
  JointVector braking_, lag_;  // rad/s^2 and s, for brakeableGain()
  OrientationTask orientation_;
};

}  // namespace coglab_controllers
