#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctrl_more/handles.hpp"
#include "ctrl_more/signal.hpp"
#include "ctrl_more/status.hpp"

namespace ctrl_more {

class Logger;

/// How the references are meant to be executed.
enum class ControlMode : std::uint8_t { Task, JointPosition, JointVelocity, JointTorque };

/// References and control efforts: what motion controllers write and feedback controllers modify
/// (Ctrl-MORE paper, section IV-B).
///
/// Every container of the paper has its own set and get; sizes are those of ControlContainer.
/// Poses must have a unit quaternion (1e-6), every number must be finite; what is refused leaves
/// the signal untouched. New keys are announced once; after freeze() a new key is an error.
/// All signals live in one contiguous buffer, so that the state at the start of a stage
/// ("original") is one copy.
///
/// Threads: one thread at a time.
class ControlStates {
 public:
  /// A store with the well-known signals (com, momenta, zmp, pelvis) and no others.
  /// @param joints number of joints; every jointSpaceReference has this size (0: the first one
  ///        that is set decides)
  /// @param period_s control period [s], > 0
  /// @param logger where new keys and wrong accesses are reported; null: Logger::standard()
  explicit ControlStates(int joints = 0, double period_s = 0.005, Logger* logger = nullptr);

  /// @name Declaring keys (outside the cycle, before freeze())
  /// @{

  /// Declares a signal, or completes the unit and frame of one that exists with the same size.
  /// @param container where it belongs
  /// @param key name within the container, not empty
  /// @param size number of doubles; must agree with the container's fixed size if it has one
  /// @param unit SI unit or list of units
  /// @param frame frame the numbers are expressed in
  Status declare(ControlContainer container, const std::string& key, int size,
                 const std::string& unit = "", const std::string& frame = "");

  /// Forbids new keys from now on. Called by the manager before the first cycle.
  void freeze() { frozen_ = true; }

  /// True after freeze().
  bool frozen() const { return frozen_; }
  /// @}

  /// @name The paper's accessors, by key (outside the cycle)
  /// Setters refuse wrong sizes, numbers that are not finite and quaternions that are not unit.
  /// Getters leave the output untouched on failure. `who` names the caller in messages.
  /// @{
  Status setTaskSpaceReferencePose(const std::string& key,
                                   const Eigen::Ref<const Eigen::VectorXd>& pose,
                                   const char* who = "user");  ///< 7: x y z [m], x y z w
  Status setTaskSpaceReferencePose(const std::string& key, const Eigen::Isometry3d& pose,
                                   const char* who = "user");  ///< the same from a transform
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
  Status setCoM(const Eigen::Vector3d& position, const char* who = "user");      ///< [m]
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
  Eigen::Vector3d getCoM() const;              ///< [m]
  Eigen::Vector3d getCoMVelocity() const;      ///< [m/s]
  Eigen::Vector3d getCoMAcceleration() const;  ///< [m/s^2]
  Eigen::Vector3d getLinearMomentum() const;   ///< [kg m/s]
  Eigen::Vector3d getAngularMomentum() const;  ///< [kg m^2/s]
  Eigen::Vector3d getZMP() const;              ///< [m]
  Eigen::Matrix3d getPelvisOrientation() const;  ///< rotation, identity until set
  /// @}

  /// @name Access by handle (inside the cycle: no allocation, no lock)
  /// @{

  /// Handle of a key; an invalid handle if there is none (outside the cycle).
  ControlSignal find(ControlContainer container, const std::string& key) const;

  /// Handle of a key that has N numbers (outside the cycle).
  /// @throws std::invalid_argument if there is no such key, or it has another size
  template <int N>
  Reference<N> find(ControlContainer container, const std::string& key) const {
    return Reference<N>(findSized(container, key, N));
  }

  /// The numbers of a signal.
  Eigen::Map<const Eigen::VectorXd> view(ControlSignal signal) const {
    return Eigen::Map<const Eigen::VectorXd>(data_.data() + signal.offset_, signal.size_);
  }

  /// The numbers of a signal, writable: for the host and its motion controllers, which own the
  /// store. Unchecked; the host's final guard judges the result.
  Eigen::Map<Eigen::VectorXd> view(ControlSignal signal) {
    return Eigen::Map<Eigen::VectorXd>(data_.data() + signal.offset_, signal.size_);
  }

  /// The numbers of a signal whose size was checked when its handle was made.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Reference<N>& handle) const {
    return constant<N>(handle.signal_);
  }

  /// As above; for whoever has the permission to modify the signal.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Modify<N>& handle) const {
    return constant<N>(handle.signal_);
  }

  /// As above, writable, for the host and its motion controllers.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<Eigen::Matrix<double, N, 1>> view(const Reference<N>& handle) {
    if (!handle.valid()) throw EmptyHandle("a control signal is used that was never looked up");
    return Eigen::Map<Eigen::Matrix<double, N, 1>>(data_.data() + handle.signal_.offset_,
                                                   handle.size());
  }

  /// The whole buffer; offsets as in ControlSignal::offset().
  const double* data() const { return data_.data(); }
  /// The whole buffer, writable, for the host and the manager.
  double* data() { return data_.data(); }
  /// Number of doubles in the buffer.
  int dataSize() const { return static_cast<int>(data_.size()); }

  /// First double of each signal, ascending.
  std::vector<int> offsets() const;

  /// Copies all numbers of a store with the same layout. No allocation.
  void copyValuesFrom(const ControlStates& other);
  /// @}

  /// Number of joints, 0 while undecided.
  int joints() const { return joints_; }
  /// Control period [s].
  double controlPeriod() const { return period_s_; }
  /// Sets the control period [s]; refused unless 0 < period < 1.
  Status setControlPeriod(double period_s);
  /// How the references are meant to be executed.
  ControlMode controlMode() const { return mode_; }
  /// Sets how the references are meant to be executed.
  void setControlMode(ControlMode mode) { mode_ = mode; }

  /// Table of one container, in order of declaration.
  std::vector<SignalInfo> signals(ControlContainer container) const;

  /// Container and key of a handle, as `container/key`, for reports.
  std::string nameOfSignal(ControlSignal signal) const;

  /// Prints every signal of every container.
  void print(std::ostream& out) const;

 private:
  struct Entry {
    SignalInfo info;
    ControlContainer container = ControlContainer::OtherReference;
  };

  Status add(ControlContainer container, const std::string& key, int size, const std::string& unit,
             const std::string& frame, const char* who, bool announce);
  Status set(ControlContainer container, const std::string& key,
             const Eigen::Ref<const Eigen::VectorXd>& value, const char* who);
  Status get(ControlContainer container, const std::string& key, Eigen::VectorXd& value,
             const char* who) const;
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> constant(ControlSignal signal) const {
    if (!signal.valid()) throw EmptyHandle("a control signal is read that was never fetched");
    return Eigen::Map<const Eigen::Matrix<double, N, 1>>(data_.data() + signal.offset_,
                                                         signal.size());
  }
  ControlSignal findSized(ControlContainer container, const std::string& key, int size) const;
  Eigen::Vector3d get3(ControlContainer container, const char* key) const;
  Status refuse(const std::string& text) const;
  std::string unknownKey(ControlContainer container, const std::string& key,
                         const char* who) const;

  Logger* logger_;
  bool frozen_ = false;
  int joints_;
  double period_s_;
  ControlMode mode_ = ControlMode::Task;
  std::unordered_map<std::string, std::uint32_t> index_;
  std::vector<Entry> entries_;
  std::vector<double> data_;
};

}  // namespace ctrl_more
