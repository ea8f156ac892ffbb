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
  /// Largest speed with which an error of the position is taken away, m/s; of larger errors K_pos
  /// is as much smaller. Without a limit, the default, it is that of eq. (6).
  double correction_speed = std::numeric_limits<double>::infinity();
  double singularity_threshold =
      0.05;  ///< the second task is rejected if its smallest singular value is below this
  /// Singular values of J_pos below this (m) are damped. They occur only with the arm stretched,
  /// which the workspace limits keep out; above it eq. (9) is the exact Moore-Penrose inverse.
  double stretch_threshold = 0.01;
  /// true: where a speed limit binds, the second task shrinks first, so that translation keeps its
  /// priority. false: both are scaled together.
  bool rotation_first_scaling = true;
  JointVector velocity_limit = JointVector::Constant(1.9);  ///< rad/s, positive
  /// What the arm can follow, rad/s^2 and rad/s^3: an error is answered only by speeds from which
  /// each joint can brake on the way that takes the error away. Small errors see K_pos and K_rot as
  /// they are; without limits, the default, all do.
  JointVector acceleration_limit = JointVector::Constant(std::numeric_limits<double>::infinity());
  JointVector jerk_limit = JointVector::Constant(std::numeric_limits<double>::infinity());
  double reaction_time = 0.015;  ///< s from a measurement until the arm follows what it led to
};

/// Result of one cycle, with everything dmp/ik_debug shows.
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
  double second_task_scale = 1.0;  ///< 0..1 of the second task that was left by the speed limits
  double scale = 1.0;  ///< 0..1 of the whole vector after that; below 1 the reference is too fast
  bool rotation_rejected = false;  ///< second task dropped near a singularity
};

/// Translation first, a second task in its null space. No allocation, no throw in `solve`.
class TwoTaskIk {
 public:
  /// @throws std::invalid_argument naming the parameter.
  explicit TwoTaskIk(const IkParameters& parameters = {});

  /// With the hand's orientation as second task.
  void solve(const ChainState& state, const JointVector& q, const CartesianReference& reference,
             IkResult& result) const noexcept;
  /// With any second task; reference.orientation_control is then up to the task.
  void solve(const ChainState& state, const JointVector& q, const CartesianReference& reference,
             const SecondTask& task, IkResult& result) const noexcept;

  const IkParameters& parameters() const noexcept { return parameters_; }

 private:
  double brakeableGain(const JointVector& way, double gain) const noexcept;

  IkParameters parameters_;
  JointVector braking_, lag_;  // rad/s^2 and s of brakeableGain()
  OrientationTask orientation_;
};

}  // namespace coglab_controllers
