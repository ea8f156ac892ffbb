#include "coglab_sim/arm_dynamics.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace coglab_sim {

using lwr_fri_bridge::fri::ControlStrategy;

ArmDynamics::ArmDynamics(const std::string& urdf, const ArmParameters& parameters,
                         const Vector7& position)
    : model_(urdf), parameters_(parameters), q_(position) {
  reset(position);
}

void ArmDynamics::reset(const Vector7& position) {
  q_ = position;
  dq_.setZero();
  block_position_ = position;
  model_.evaluate(q_, dq_, terms_);
  joint_torque_ = terms_.gravity;
  motor_torque_ = terms_.gravity;
  external_torque_.setZero();
  locked_ = brakes_;
}

void ArmDynamics::setBrakes(bool on) {
  brakes_ = on;
  if (!on) locked_ = false;
}

void ArmDynamics::setBlock(bool on) {
  if (on && !blocked_) block_position_ = q_;
  blocked_ = on;
}

Twist ArmDynamics::palmTwist() const {
  const Vector6 twist = terms_.jacobian * dq_;
  return {twist.head<3>(), twist.tail<3>()};
}

ArmDynamics::Law ArmDynamics::servoLaw(const ServoCommand& command, double dt) const {
  const Vector7 inertia = terms_.mass.diagonal() + parameters_.rotor_inertia;
  Law law{Vector7::Zero(), Matrix7::Zero()};
  switch (command.strategy) {
    case ControlStrategy::Position: {
      const double w = parameters_.servo_bandwidth;
      const Vector7 stiffness = w * w * inertia;
      const Vector7 damping = 2.0 * w * inertia;
      law.constant =
          stiffness.cwiseProduct(command.position - q_) + damping.cwiseProduct(command.velocity);
      law.damping.diagonal() = damping + dt * stiffness;
      break;
    }
    case ControlStrategy::JointImpedance: {
      const Vector7 critical = 2.0 * (command.stiffness.array() * inertia.array()).sqrt();
      const Vector7 damping = command.damping.cwiseProduct(critical);
      law.constant = command.stiffness.cwiseProduct(command.position - q_) +
                     damping.cwiseProduct(command.velocity) + command.torque;
      law.damping.diagonal() = damping + dt * command.stiffness;
      break;
    }
    case ControlStrategy::CartesianImpedance: {
      const Matrix67& jacobian = terms_.jacobian;
      // Mass of each tip direction on its own: 1 / (J (M+B)^-1 J^T)_ii.
      Matrix7 total = terms_.mass;
      total.diagonal() += parameters_.rotor_inertia;
      const Eigen::LLT<Matrix7> factor(total);
      Eigen::Matrix<double, 7, 6> half = jacobian.transpose();
      factor.matrixL().solveInPlace(half);
      const Vector6 mass = half.colwise().squaredNorm().cwiseInverse().transpose();
      const Vector6 damping = 2.0 * command.frame_damping.array() *
                              (command.frame_stiffness.array() * mass.array()).sqrt();

      Vector6 error;
      error << command.frame.position - terms_.tip.position,
          rotationBetween(terms_.tip.rotation, command.frame.rotation);
      Vector6 wanted;
      wanted << command.frame_velocity.linear, command.frame_velocity.angular;
      const Vector6 force = command.frame_stiffness.cwiseProduct(error) +
                            damping.cwiseProduct(wanted) + command.force;
      law.constant = jacobian.transpose() * force;
      law.damping =
          jacobian.transpose() * (damping + dt * command.frame_stiffness).asDiagonal() * jacobian;

      // Posture of the redundant joint: a soft spring to the joint set-point, filtered so that the
      // tip does not feel it.
      Eigen::Matrix<double, 6, 6> gram = jacobian * jacobian.transpose();
      gram.diagonal().array() += 1e-6;
      const Eigen::LLT<Eigen::Matrix<double, 6, 6>> gram_factor(gram);
      const double critical = 2.0 * std::sqrt(parameters_.nullspace_stiffness * inertia.mean());
      const Vector7 posture =
          parameters_.nullspace_stiffness * (command.position - q_) - critical * dq_;
      law.constant += posture - jacobian.transpose() * gram_factor.solve(jacobian * posture);
      break;
    }
    case ControlStrategy::Other:
      break;
  }
  // The controller carries the arm's own weight and velocity forces in every strategy; it does not
  // know of loads.
  law.constant += terms_.gravity + terms_.coriolis;
  return law;
}

void ArmDynamics::step(const ServoCommand& command, const Wrench& palm, double dt) {
  Wrench outside = palm;
  outside.force.z() -= 9.81 * parameters_.unknown_load;
  const Vector7 contact = terms_.jacobian.transpose() * outside.stacked();

  if (locked_) {
    dq_.setZero();
    motor_torque_.setZero();
    external_torque_ = contact;
    joint_torque_ = terms_.gravity - contact;
    return;
  }

  Matrix7 system = terms_.mass;
  system.diagonal() += parameters_.rotor_inertia;
  const Vector7 before = dq_;
  Vector7 push = system * dq_ - dt * (terms_.coriolis + terms_.gravity - contact);

  // Everything that resists velocity linearly, per joint.
  Vector7 resistance = model_.damping();
  resistance.array() +=
      parameters_.coulomb_friction.array() / dq_.array().abs().max(parameters_.coulomb_speed);
  if (brakes_) {
    resistance.array() += parameters_.brake_torque_share * parameters_.torque_limit.array() /
                          dq_.array().abs().max(0.02);
  }
  Vector7 block_damping = Vector7::Zero(), block_constant = Vector7::Zero();
  if (blocked_) {
    const Vector7 inertia = system.diagonal();
    block_damping = 2.0 * (parameters_.block_stiffness * inertia.array()).sqrt();
    block_damping.array() += dt * parameters_.block_stiffness;
    block_constant = parameters_.block_stiffness * (block_position_ - q_);
  }
  system.diagonal() += dt * (resistance + block_damping);
  push += dt * block_constant;

  Law law{Vector7::Zero(), Matrix7::Zero()};
  if (!brakes_) law = servoLaw(command, dt);
  Matrix7 with_servo = system + dt * law.damping;
  dq_ = with_servo.llt().solve(push + dt * law.constant);
  motor_torque_ = law.constant - law.damping * dq_;

  const Vector7& limit = parameters_.torque_limit;
  if (((motor_torque_.array().abs() - limit.array()) > 0.0).any()) {
    // Saturated motors give their limit, the others follow their law; one correction is enough for
    // a 1 ms step.
    for (int i = 0; i < 7; ++i) {
      if (std::abs(motor_torque_[i]) <= limit[i]) continue;
      law.constant[i] = std::copysign(limit[i], motor_torque_[i]);
      law.damping.row(i).setZero();
    }
    with_servo = system + dt * law.damping;
    dq_ = with_servo.partialPivLu().solve(push + dt * law.constant);
    motor_torque_ = (law.constant - law.damping * dq_).cwiseMax(-limit).cwiseMin(limit);
  }

  const Vector7 acceleration = (dq_ - before) / dt;
  const Vector7 block_torque = block_constant - block_damping.cwiseProduct(dq_);
  external_torque_ = contact + block_torque;
  joint_torque_ = terms_.mass * acceleration + terms_.coriolis + terms_.gravity - external_torque_;

  q_ += dt * dq_;
  if (brakes_ && dq_.cwiseAbs().maxCoeff() < 0.005) {
    locked_ = true;
    dq_.setZero();
  }
  model_.evaluate(q_, dq_, terms_);
}

}  // namespace coglab_sim
