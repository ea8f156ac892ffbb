#include "coglab_sim/krc/servos.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "coglab_sim/random.hpp"

namespace coglab_sim::krc {

using lwr_fri_bridge::fri::ControlStrategy;

namespace {

constexpr std::uint64_t kStream = 11;  // random stream of the model's errors

double share(Random& random, double largest) {
  return 1.0 + largest * (2.0 * random.uniform() - 1.0);
}

ModelErrors drawErrors(const ServoParameters& parameters, Random& random) {
  ModelErrors errors;
  errors.payload = share(random, parameters.payload_error);
  for (double& inertia : errors.inertia) inertia = share(random, parameters.inertia_error);
  return errors;
}

Vector7 withErrors(Vector7 inertia, double largest, std::uint64_t seed) {
  Random random(seed, kStream + 1);
  for (double& value : inertia) value *= share(random, largest);
  return inertia;
}

ModelErrors errorsOf(const ServoParameters& parameters, std::uint64_t seed) {
  Random random(seed, kStream);
  return drawErrors(parameters, random);
}

}  // namespace

Servos::Servos(const std::string& urdf, const ServoParameters& parameters,
               const Vector7& rotor_inertia, std::uint64_t seed)
    : parameters_(parameters),
      rotor_inertia_(withErrors(rotor_inertia, parameters.inertia_error, seed)),
      model_(urdf, errorsOf(parameters, seed)) {
  observe(position_, velocity_);
}

void Servos::observe(const Vector7& position, const Vector7& velocity) {
  position_ = position;
  velocity_ = velocity;
  model_.evaluateDynamics(position_, velocity_, terms_);
  has_kinematics_ = false;
}

const ArmTerms& Servos::terms() const {
  if (!has_kinematics_) model_.evaluateKinematics(position_, terms_);
  has_kinematics_ = true;
  return terms_;
}

Servos::Law Servos::jointLaw(const ServoCommand& command, const Vector7& stiffness,
                             const Vector7& damping, double dt) const {
  Law law;
  law.constant =
      stiffness.cwiseProduct(command.position - position_) + damping.cwiseProduct(command.velocity);
  law.damping.diagonal() = damping + dt * stiffness;
  law.pull = law.damping * command.velocity;
  return law;
}

Servos::Law Servos::frameLaw(const ServoCommand& command, double dt) const {
  const ArmTerms& terms = this->terms();
  const Matrix67& jacobian = terms.jacobian;
  // Effective mass of each tip direction alone: 1 / (J (M+B)^-1 J^T)_ii.
  Matrix7 total = terms.mass;
  total.diagonal() += rotor_inertia_;
  const Eigen::LLT<Matrix7> factor(total);
  Eigen::Matrix<double, 7, 6> half = jacobian.transpose();
  factor.matrixL().solveInPlace(half);
  const Vector6 mass = half.colwise().squaredNorm().cwiseInverse().transpose();
  const Vector6 damping =
      2.0 * command.frame_damping.array() * (command.frame_stiffness.array() * mass.array()).sqrt();

  Vector6 error, wanted;
  error << command.frame.position - terms.tip.position,
      rotationBetween(terms.tip.rotation, command.frame.rotation);
  wanted << command.frame_velocity.linear, command.frame_velocity.angular;
  const Vector6 force =
      command.frame_stiffness.cwiseProduct(error) + damping.cwiseProduct(wanted) + command.force;
  Law law;
  law.constant = jacobian.transpose() * force;
  law.damping =
      jacobian.transpose() * (damping + dt * command.frame_stiffness).asDiagonal() * jacobian;
  law.pull = jacobian.transpose() * (damping + dt * command.frame_stiffness).cwiseProduct(wanted);

  // Posture of the redundant joint: a soft spring to the joint set-point, projected so that it
  // exerts no force at the tip.
  Eigen::Matrix<double, 6, 6> gram = jacobian * jacobian.transpose();
  gram.diagonal().array() += 1e-6;
  const Eigen::LLT<Eigen::Matrix<double, 6, 6>> gram_factor(gram);
  const double stiffness = parameters_.nullspace_stiffness;
  const double critical = 2.0 * std::sqrt(stiffness * total.diagonal().mean());
  const Vector7 posture = stiffness * (command.position - position_) - critical * velocity_;
  law.constant += posture - jacobian.transpose() * gram_factor.solve(jacobian * posture);
  return law;
}

const Vector7& Servos::command(const ServoCommand& command, double dt) {
  Matrix7 system = terms_.mass;
  system.diagonal() += rotor_inertia_;
  const Vector7 inertia = system.diagonal();
  Law law;
  switch (command.strategy) {
    case ControlStrategy::Position: {
      const double w = parameters_.bandwidth;
      law = jointLaw(command, w * w * inertia, 2.0 * w * inertia, dt);
      break;
    }
    case ControlStrategy::JointImpedance: {
      const Vector7 critical = 2.0 * (command.stiffness.array() * inertia.array()).sqrt();
      law = jointLaw(command, command.stiffness, command.damping.cwiseProduct(critical), dt);
      law.constant += command.torque;
      break;
    }
    case ControlStrategy::CartesianImpedance:
      law = frameLaw(command, dt);
      break;
    case ControlStrategy::Other:
      break;
  }
  const Vector7 push = system * velocity_ + dt * law.pull;
  const Vector7 after = (system + dt * law.damping).llt().solve(push);
  // Every strategy compensates the arm's own gravity and Coriolis forces, but not loads.
  const Vector7& limit = parameters_.torque_limit;
  motor_torque_ = (law.constant - law.damping * after + terms_.gravity + terms_.coriolis)
                      .cwiseMax(-limit)
                      .cwiseMin(limit);
  return motor_torque_;
}

}  // namespace coglab_sim::krc
