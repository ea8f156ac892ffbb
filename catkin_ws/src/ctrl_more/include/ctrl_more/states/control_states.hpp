#pragma once

#include <string>

#include <Eigen/Core>

#include "ctrl_more/states/control_store.hpp"

namespace ctrl_more {

/// References and control efforts: what motion controllers write and feedback controllers modify
/// (Ctrl-MORE paper, section IV-B).
///
/// Every container of the paper has its own set and get, each one line over the store's; sizes are
/// those of ControlContainer. Poses must have a unit quaternion (1e-6), every number must be
/// finite; what is refused leaves the signal untouched. New keys are announced once; after
/// freeze() a new key is an error.
class ControlStates : public ControlStore {
 public:
  using ControlStore::ControlStore;

  /// @name The paper's accessors, by key (outside the cycle)
  /// Setters refuse wrong sizes, numbers that are not finite and quaternions that are not unit.
  /// Getters leave the output untouched on failure. `who` names the caller in messages.
  /// @{
  Status setTaskSpaceReferencePose(const std::string& key,
                                   const Eigen::Ref<const Eigen::VectorXd>& pose,
                                   const char* who = "user");  ///< 7: x y z [m], x y z w
  Status setTaskSpaceReferenceVel(const std::string& key,
                                  const Eigen::Ref<const Eigen::VectorXd>& velocity,
                                  const char* who = "user");  ///< 6: [m/s], [rad/s]
  Status setTaskSpaceReferenceAcc(const std::string& key,
                                  const Eigen::Ref<const Eigen::VectorXd>& acceleration,
                                  const char* who = "user");  ///< 6: [m/s^2], [rad/s^2]
  Status setJointSpaceReference(const std::string& type,
                                const Eigen::Ref<const Eigen::VectorXd>& reference,
                                const char* who = "user");  ///< Position, Velocity or Torque
  Status setOtherReference(const std::string& key,
                           const Eigen::Ref<const Eigen::VectorXd>& reference,
                           const char* who = "user");  ///< size fixed by its first writer
  Status setCoM(const Eigen::Vector3d& position, const char* who = "user");          ///< [m]
  Status setCoMVelocity(const Eigen::Vector3d& velocity, const char* who = "user");  ///< [m/s]
  Status setCoMAcceleration(const Eigen::Vector3d& acceleration,
                            const char* who = "user");  ///< [m/s^2]
  Status setLinearMomentum(const Eigen::Vector3d& momentum, const char* who = "user");
  ///< [kg m/s]
  Status setAngularMomentum(const Eigen::Vector3d& momentum, const char* who = "user");
  ///< [kg m^2/s]
  Status setZMP(const Eigen::Vector3d& zmp, const char* who = "user");  ///< [m]
  Status setZMP(const std::string& key, const Eigen::Vector3d& zmp,
                const char* who = "user");  ///< a named one [m]
  /// Re-orthonormalised; refused if the matrix is further than 1e-3 from a rotation.
  Status setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who = "user");
  /// From roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll).
  Status setPelvisOrientation(double roll, double pitch, double yaw, const char* who = "user");

  Status getTaskSpaceReferencePose(const std::string& key, Eigen::VectorXd& pose,
                                   const char* who = "user") const;  ///< 7
  Status getTaskSpaceReferenceVel(const std::string& key, Eigen::VectorXd& velocity,
                                  const char* who = "user") const;  ///< 6
  Status getTaskSpaceReferenceAcc(const std::string& key, Eigen::VectorXd& acceleration,
                                  const char* who = "user") const;  ///< 6
  Status getJointSpaceReference(const std::string& type, Eigen::VectorXd& reference,
                                const char* who = "user") const;  ///< one per joint
  Status getOtherReference(const std::string& key, Eigen::VectorXd& reference,
                           const char* who = "user") const;  ///< as declared
  Status getZMP(const std::string& key, Eigen::Vector3d& zmp, const char* who = "user") const;
  ///< a named one [m]
  Eigen::Vector3d getCoM() const;                ///< [m]
  Eigen::Vector3d getCoMVelocity() const;        ///< [m/s]
  Eigen::Vector3d getCoMAcceleration() const;    ///< [m/s^2]
  Eigen::Vector3d getLinearMomentum() const;     ///< [kg m/s]
  Eigen::Vector3d getAngularMomentum() const;    ///< [kg m^2/s]
  Eigen::Vector3d getZMP() const;                ///< [m]
  Eigen::Matrix3d getPelvisOrientation() const;  ///< rotation, identity until set
                                                 /// @}

 private:
  Eigen::Vector3d get3(ControlContainer container, const char* key) const {
    return view(find<3>(container, key));
  }
};

}  // namespace ctrl_more
