/// @file
/// Motion of the arm under its joint servos, outside forces, brakes and a block.
///
///   (M(q) + B) ddq + C(q, dq) dq + g(q) + friction = tau_motor + J^T F + tau_block
///
/// with the reflected motor inertia B. Semi-implicit Euler; springs and dampers of servos, block
/// and friction enter the velocity equation linearly implicitly, so that a stiff servo is stable at
/// the 1 ms step whatever its gain.
#pragma once

#include "coglab_sim/arm_model.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim {

/// Figures of the drives. The first three are published; the others are ours.
struct ArmParameters {
  /// Nm; CentroEPiaggio, FloBaRoID and Gaz et al. 2014 agree on these.
  Vector7 torque_limit = (Vector7() << 176, 176, 100, 100, 100, 38, 38).finished();
  /// kg m^2 at the link; ours, the order that the gear ratios 160/160/160/160/100/160/160 of the
  /// DLR LWR III suggest.
  Vector7 rotor_inertia = (Vector7() << 3.0, 3.0, 2.0, 2.0, 0.8, 0.4, 0.4).finished();
  /// Nm; ours. The viscous part comes from the URDF.
  Vector7 coulomb_friction = (Vector7() << 0.4, 0.4, 0.25, 0.25, 0.2, 0.1, 0.1).finished();
  double coulomb_speed = 0.01;        ///< rad/s over which Coulomb friction reverses
  double servo_bandwidth = 60.0;      ///< rad/s of the position servo, critically damped
  double nullspace_stiffness = 20.0;  ///< Nm/rad toward the joint set-point in Cartesian impedance
  double block_stiffness = 2e5;       ///< Nm/rad of whatever holds the arm when it is blocked
  double brake_torque_share = 2.0;    ///< brake torque over motor torque limit
  double unknown_load = 0.0;          ///< kg at the palm that the robot controller does not know of
};

/// What the robot controller asks of the joint servos during one step.
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

/// The arm as a body that moves in time.
class ArmDynamics {
 public:
  /// @throws std::runtime_error from ArmModel
  ArmDynamics(const std::string& urdf, const ArmParameters& parameters, const Vector7& position);

  /// Puts the arm somewhere, at rest.
  void reset(const Vector7& position);

  /// Advances by `dt` s. `palm` is what the surroundings exert on the tip, about its origin.
  void step(const ServoCommand& command, const Wrench& palm, double dt);

  /// With brakes on the motors give no torque; the arm is braked to a stop and then held.
  void setBrakes(bool on);
  /// Somebody holds all joints where they are now, or lets go.
  void setBlock(bool on);

  const Vector7& position() const { return q_; }    ///< rad
  const Vector7& velocity() const { return dq_; }   ///< rad/s
  const ArmTerms& terms() const { return terms_; }  ///< at the present state
  Twist palmTwist() const;                          ///< of the tip
  bool brakesOn() const { return brakes_; }
  bool locked() const { return locked_; }  ///< stands still on its brakes
  bool blocked() const { return blocked_; }
  /// What ideal joint torque sensors read: torque between motor and link, Nm.
  const Vector7& jointTorque() const { return joint_torque_; }
  /// Torque of everything outside the controller's model on the joints: palm, block, unknown load;
  /// Nm.
  const Vector7& externalTorque() const { return external_torque_; }
  /// Motor torque of the last step, Nm, within the limits.
  const Vector7& motorTorque() const { return motor_torque_; }
  const ArmParameters& parameters() const { return parameters_; }

 private:
  /// Linear law of the servos: torque = constant - damping * new velocity, for the joint servos
  /// diagonal.
  struct Law {
    Vector7 constant;
    Matrix7 damping;
  };
  Law servoLaw(const ServoCommand& command, double dt) const;

  ArmModel model_;
  ArmParameters parameters_;
  ArmTerms terms_;
  Vector7 q_, dq_ = Vector7::Zero();
  Vector7 block_position_ = Vector7::Zero();
  Vector7 joint_torque_ = Vector7::Zero(), external_torque_ = Vector7::Zero(),
          motor_torque_ = Vector7::Zero();
  bool brakes_ = false, locked_ = false, blocked_ = false;
};

}  // namespace coglab_sim
