/// @file
/// The controller's model of the arm, and its joint servos.
///
/// The model is KDL's on the robot description, with the errors of a real controller: the mass of
/// the hand and the inertias are wrong by a few percent, friction and loads are unknown. The arm
/// itself is simulated in plant/.
#pragma once

#include <cstdint>
#include <string>

#include "coglab_sim/arm_model.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// Defaults, units and texts are in parameter_table.inc.
struct ServoParameters {
#define SERVOS(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// Input of the joint servos for one step.
struct ServoCommand {
  lwr_fri_bridge::fri::ControlStrategy strategy = lwr_fri_bridge::fri::ControlStrategy::Position;
  Vector7 position = Vector7::Zero();   ///< rad
  Vector7 velocity = Vector7::Zero();   ///< of the set-point, rad/s
  Vector7 torque = Vector7::Zero();     ///< added, Nm (joint impedance)
  Vector7 stiffness = Vector7::Zero();  ///< Nm/rad (joint impedance)
  Vector7 damping = Vector7::Zero();    ///< normalised, 1 is critical
  Pose frame;                           ///< set-point of the tip in the world (Cartesian impedance)
  Twist frame_velocity;                 ///< of that set-point
  Vector6 force = Vector6::Zero();      ///< added at the tip, world axes, N and Nm
  Vector6 frame_stiffness = Vector6::Zero();  ///< x y z (N/m) rx ry rz (Nm/rad), world axes
  Vector6 frame_damping = Vector6::Zero();    ///< normalised
};

/// Servos of the three strategies, with a model of the arm. Dampers are linearly implicit: they use
/// the velocity that the model predicts after the step. A stiff servo is therefore stable at 1 ms.
class Servos {
 public:
  /// @param rotor_inertia  true values, kg m^2; the servos use them with an error drawn with `seed`
  /// @throws std::runtime_error from ArmModel
  Servos(const std::string& urdf, const ServoParameters& parameters, const Vector7& rotor_inertia,
         std::uint64_t seed);

  /// Takes the newest encoder values, rad and rad/s.
  void observe(const Vector7& position, const Vector7& velocity);

  /// Returns the limited motor torques for the next `dt` s, Nm.
  const Vector7& command(const ServoCommand& command, double dt);
  /// Switches the motors off.
  void off() { motor_torque_.setZero(); }

  /// External torque on the joints, Nm: the torque that the model needs at this acceleration
  /// (rad/s^2) minus the measured torque.
  Vector7 external(const Vector7& joint_torque, const Vector7& acceleration) const {
    return terms_.mass * acceleration + terms_.coriolis + terms_.gravity - joint_torque;
  }

  const Vector7& position() const { return position_; }
  const Vector7& velocity() const { return velocity_; }
  /// Of the controller's model at the newest encoder values. Not thread-safe.
  const ArmTerms& terms() const;
  const Vector7& motorTorque() const { return motor_torque_; }
  const ServoParameters& parameters() const { return parameters_; }

 private:
  /// Linear law: torque = constant - damping * velocity after the step. That velocity is predicted
  /// from the dampers only (`pull`: their torque on a standing arm), because a held arm does not
  /// follow its springs.
  struct Law {
    Vector7 constant = Vector7::Zero(), pull = Vector7::Zero();
    Matrix7 damping = Matrix7::Zero();
  };
  Law jointLaw(const ServoCommand& command, const Vector7& stiffness, const Vector7& damping,
               double dt) const;
  Law frameLaw(const ServoCommand& command, double dt) const;

  ServoParameters parameters_;
  Vector7 rotor_inertia_;
  // Most steps need no kinematics, so terms() computes them.
  mutable ArmModel model_;
  mutable ArmTerms terms_;
  mutable bool has_kinematics_ = false;
  Vector7 position_ = Vector7::Zero(), velocity_ = Vector7::Zero(), motor_torque_ = Vector7::Zero();
};

}  // namespace coglab_sim::krc
