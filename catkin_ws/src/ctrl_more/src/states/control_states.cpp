#include "ctrl_more/states/control_states.hpp"

#include <cmath>

#include <Eigen/Geometry>

#include "ctrl_more/states/so3.hpp"

namespace ctrl_more {
namespace {

constexpr double kRotationTolerance = 1e-3;

}  // namespace

Status ControlStates::setTaskSpaceReferencePose(const std::string& key,
                                                const Eigen::Ref<const Eigen::VectorXd>& pose,
                                                const char* who) {
  return set(ControlContainer::TaskSpaceReferencePose, key, pose, who);
}

Status ControlStates::setTaskSpaceReferenceVel(const std::string& key,
                                               const Eigen::Ref<const Eigen::VectorXd>& velocity,
                                               const char* who) {
  return set(ControlContainer::TaskSpaceReferenceVel, key, velocity, who);
}

Status ControlStates::setTaskSpaceReferenceAcc(
    const std::string& key, const Eigen::Ref<const Eigen::VectorXd>& acceleration,
    const char* who) {
  return set(ControlContainer::TaskSpaceReferenceAcc, key, acceleration, who);
}

Status ControlStates::setJointSpaceReference(const std::string& type,
                                             const Eigen::Ref<const Eigen::VectorXd>& reference,
                                             const char* who) {
  return set(ControlContainer::JointSpaceReference, type, reference, who);
}

Status ControlStates::setOtherReference(const std::string& key,
                                        const Eigen::Ref<const Eigen::VectorXd>& reference,
                                        const char* who) {
  return set(ControlContainer::OtherReference, key, reference, who);
}

Status ControlStates::setCoM(const Eigen::Vector3d& position, const char* who) {
  return set(ControlContainer::CentreOfMass, "com", position, who);
}

Status ControlStates::setCoMVelocity(const Eigen::Vector3d& velocity, const char* who) {
  return set(ControlContainer::CentreOfMass, "comVelocity", velocity, who);
}

Status ControlStates::setCoMAcceleration(const Eigen::Vector3d& acceleration, const char* who) {
  return set(ControlContainer::CentreOfMass, "comAcceleration", acceleration, who);
}

Status ControlStates::setLinearMomentum(const Eigen::Vector3d& momentum, const char* who) {
  return set(ControlContainer::LinearMomentum, "linearMomentum", momentum, who);
}

Status ControlStates::setAngularMomentum(const Eigen::Vector3d& momentum, const char* who) {
  return set(ControlContainer::AngularMomentum, "angularMomentum", momentum, who);
}

Status ControlStates::setZMP(const Eigen::Vector3d& zmp, const char* who) {
  return set(ControlContainer::Zmp, "zmp", zmp, who);
}

Status ControlStates::setZMP(const std::string& key, const Eigen::Vector3d& zmp, const char* who) {
  return set(ControlContainer::Zmp, key, zmp, who);
}

Status ControlStates::setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who) {
  const double error = (orientation * orientation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error <= kRotationTolerance) || !(orientation.determinant() > 0.0)) {
    return refuse(std::string(who) + ": pelvisOrientation/pelvis expects a rotation matrix, got " +
                  "one with |R R^T - 1| = " + std::to_string(error) + " and determinant " +
                  std::to_string(orientation.determinant()));
  }
  const Eigen::Vector4d q = Eigen::Quaterniond(orientation).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Status ControlStates::setPelvisOrientation(double roll, double pitch, double yaw, const char* who) {
  if (!std::isfinite(roll) || !std::isfinite(pitch) || !std::isfinite(yaw)) {
    return refuse(std::string(who) + ": pelvisOrientation/pelvis got an angle that is not finite");
  }
  const Eigen::Vector4d q = fromRollPitchYaw(roll, pitch, yaw).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Status ControlStates::getTaskSpaceReferencePose(const std::string& key, Eigen::VectorXd& pose,
                                                const char* who) const {
  return get(ControlContainer::TaskSpaceReferencePose, key, pose, who);
}

Status ControlStates::getTaskSpaceReferenceVel(const std::string& key, Eigen::VectorXd& velocity,
                                               const char* who) const {
  return get(ControlContainer::TaskSpaceReferenceVel, key, velocity, who);
}

Status ControlStates::getTaskSpaceReferenceAcc(const std::string& key,
                                               Eigen::VectorXd& acceleration,
                                               const char* who) const {
  return get(ControlContainer::TaskSpaceReferenceAcc, key, acceleration, who);
}

Status ControlStates::getJointSpaceReference(const std::string& type, Eigen::VectorXd& reference,
                                             const char* who) const {
  return get(ControlContainer::JointSpaceReference, type, reference, who);
}

Status ControlStates::getOtherReference(const std::string& key, Eigen::VectorXd& reference,
                                        const char* who) const {
  return get(ControlContainer::OtherReference, key, reference, who);
}

Status ControlStates::getZMP(const std::string& key, Eigen::Vector3d& zmp, const char* who) const {
  Eigen::VectorXd value;
  const Status status = get(ControlContainer::Zmp, key, value, who);
  if (status) zmp = value;
  return status;
}

Eigen::Vector3d ControlStates::getCoM() const {
  return get3(ControlContainer::CentreOfMass, "com");
}
Eigen::Vector3d ControlStates::getCoMVelocity() const {
  return get3(ControlContainer::CentreOfMass, "comVelocity");
}
Eigen::Vector3d ControlStates::getCoMAcceleration() const {
  return get3(ControlContainer::CentreOfMass, "comAcceleration");
}
Eigen::Vector3d ControlStates::getLinearMomentum() const {
  return get3(ControlContainer::LinearMomentum, "linearMomentum");
}
Eigen::Vector3d ControlStates::getAngularMomentum() const {
  return get3(ControlContainer::AngularMomentum, "angularMomentum");
}
Eigen::Vector3d ControlStates::getZMP() const { return get3(ControlContainer::Zmp, "zmp"); }

Eigen::Matrix3d ControlStates::getPelvisOrientation() const {
  const Reference<4> pelvis = find<4>(ControlContainer::PelvisOrientation, "pelvis");
  return Eigen::Quaterniond(view(pelvis)).normalized().toRotationMatrix();
}

}  // namespace ctrl_more
