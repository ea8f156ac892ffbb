/// @file
/// What the robot controller knows of its arm, and its joint servos.
///
/// The controller's model is KDL's on the robot description, with errors as a real one has them:
/// the mass of the hand and the inertias are off by a few percent, friction and loads are unknown.
/// The arm itself moves elsewhere (plant/).
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

/// Servos of the three strategies on a model of the arm. Dampers are linearly implicit in the
/// velocity that the model expects after the step, so that a stiff servo is stable at 1 ms.
class Servos {
 public:
  /// @param rotor_inertia  true ones, kg m^2; the servos know them with an error drawn by `seed`
  /// @throws std::runtime_error from ArmModel
  Servos(const std::string& urdf, const ServoParameters& parameters, const Vector7& rotor_inertia,
         std::uint64_t seed);

  /// The encoders' newest values, rad and rad/s.
  void observe(const Vector7& position, const Vector7& velocity);

  /// Motor torques for the next `dt` s, within the limits, Nm.
  const Vector7& command(const ServoCommand& command, double dt);
  /// The motors are off.
  void off() { motor_torque_.setZero(); }

  /// Torque of the surroundings on the joints, Nm: what the torque sensors read, less what the
  /// model says that the arm itself needs at this acceleration (rad/s^2).
  Vector7 external(const Vector7& joint_torque, const Vector7& acceleration) const {
    return terms_.mass * acceleration + terms_.coriolis + terms_.gravity - joint_torque;
  }

  const Vector7& position() const { return position_; }
  const Vector7& velocity() const { return velocity_; }
  const ArmTerms& terms() const { return terms_; }  ///< of the controller's model
  const Vector7& motorTorque() const { return motor_torque_; }
  const ServoParameters& parameters() const { return parameters_; }

 private:
  /// Linear law: torque = constant - damping * velocity after the step. That velocity is expected
  /// from the dampers alone (`pull`: what they do where the arm stands still), since an arm that
  /// something else holds does not follow its springs.
  struct Law {
    Vector7 constant = Vector7::Zero(), pull = Vector7::Zero();
    Matrix7 damping = Matrix7::Zero();
  };
  Law jointLaw(const ServoCommand& command, const Vector7& stiffness, const Vector7& damping,
               double dt) const;
  Law frameLaw(const ServoCommand& command, double dt) const;

  ServoParameters parameters_;
  ArmModel model_;
  Vector7 rotor_inertia_;
  ArmTerms terms_;
  Vector7 position_ = Vector7::Zero(), velocity_ = Vector7::Zero(), motor_torque_ = Vector7::Zero();
};

}  // namespace coglab_sim::krc
