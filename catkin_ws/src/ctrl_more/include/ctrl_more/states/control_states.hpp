#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "ctrl_more/states/handles.hpp"
#include "ctrl_more/states/signal.hpp"
#include "ctrl_more/states/signal_table.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// How the references are meant to be executed.
enum class ControlMode : std::uint8_t { Task, JointPosition, JointVelocity, JointTorque };

/// References and control efforts: what motion controllers write and feedback controllers modify
/// (Ctrl-MORE paper, section IV-B).
///
/// Every container of the paper has its own set and get by key, for outside the cycle; inside it
/// signals are read and written by handle. Sizes are those of ControlContainer. Poses must have a
/// unit quaternion (1e-6), every number must be finite; what is refused leaves the signal
/// untouched. New keys are announced once; after freeze() a new key is an error.
///
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
  void freeze() { table_.freeze(); }

  /// True after freeze().
  bool frozen() const { return table_.frozen(); }
  /// @}

  /// @name The paper's accessors, by key (outside the cycle)
  /// Setters refuse wrong sizes, numbers that are not finite and quaternions that are not unit.
  /// Getters leave the output untouched on failure. `who` names the caller in messages.
  /// @{
  using Values = Eigen::Ref<const Eigen::VectorXd>;
  using Vector3 = Eigen::Vector3d;

  /// 7: x y z [m], quaternion x y z w.
  Status setTaskSpaceReferencePose(const std::string& key, const Values& value,
                                   const char* who = "user") {
    return set(ControlContainer::TaskSpaceReferencePose, key, value, who);
  }
  Status getTaskSpaceReferencePose(const std::string& key, Eigen::VectorXd& value,
                                   const char* who = "user") const {
    return get(ControlContainer::TaskSpaceReferencePose, key, value, who);
  }
  /// 6: [m/s], [rad/s].
  Status setTaskSpaceReferenceVel(const std::string& key, const Values& value,
                                  const char* who = "user") {
    return set(ControlContainer::TaskSpaceReferenceVel, key, value, who);
  }
  Status getTaskSpaceReferenceVel(const std::string& key, Eigen::VectorXd& value,
                                  const char* who = "user") const {
    return get(ControlContainer::TaskSpaceReferenceVel, key, value, who);
  }
  /// 6: [m/s^2], [rad/s^2].
  Status setTaskSpaceReferenceAcc(const std::string& key, const Values& value,
                                  const char* who = "user") {
    return set(ControlContainer::TaskSpaceReferenceAcc, key, value, who);
  }
  Status getTaskSpaceReferenceAcc(const std::string& key, Eigen::VectorXd& value,
                                  const char* who = "user") const {
    return get(ControlContainer::TaskSpaceReferenceAcc, key, value, who);
  }
  /// One per joint; Position, Velocity or Torque.
  Status setJointSpaceReference(const std::string& type, const Values& value,
                                const char* who = "user") {
    return set(ControlContainer::JointSpaceReference, type, value, who);
  }
  Status getJointSpaceReference(const std::string& type, Eigen::VectorXd& value,
                                const char* who = "user") const {
    return get(ControlContainer::JointSpaceReference, type, value, who);
  }
  /// Size fixed by its first writer.
  Status setOtherReference(const std::string& key, const Values& value, const char* who = "user") {
    return set(ControlContainer::OtherReference, key, value, who);
  }
  Status getOtherReference(const std::string& key, Eigen::VectorXd& value,
                           const char* who = "user") const {
    return get(ControlContainer::OtherReference, key, value, who);
  }
  /// [m]
  Status setCoM(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::CentreOfMass, "com", value, who);
  }
  Vector3 getCoM() const { return view(find<3>(ControlContainer::CentreOfMass, "com")); }
  /// [m/s]
  Status setCoMVelocity(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::CentreOfMass, "comVelocity", value, who);
  }
  Vector3 getCoMVelocity() const {
    return view(find<3>(ControlContainer::CentreOfMass, "comVelocity"));
  }
  /// [m/s^2]
  Status setCoMAcceleration(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::CentreOfMass, "comAcceleration", value, who);
  }
  Vector3 getCoMAcceleration() const {
    return view(find<3>(ControlContainer::CentreOfMass, "comAcceleration"));
  }
  /// [kg m/s]
  Status setLinearMomentum(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::LinearMomentum, "linearMomentum", value, who);
  }
  Vector3 getLinearMomentum() const {
    return view(find<3>(ControlContainer::LinearMomentum, "linearMomentum"));
  }
  /// [kg m^2/s]
  Status setAngularMomentum(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::AngularMomentum, "angularMomentum", value, who);
  }
  Vector3 getAngularMomentum() const {
    return view(find<3>(ControlContainer::AngularMomentum, "angularMomentum"));
  }
  /// [m]
  Status setZMP(const Vector3& value, const char* who = "user") {
    return set(ControlContainer::Zmp, "zmp", value, who);
  }
  Vector3 getZMP() const { return view(find<3>(ControlContainer::Zmp, "zmp")); }
  /// A named ZMP [m].
  Status setZMP(const std::string& key, const Vector3& value, const char* who = "user") {
    return set(ControlContainer::Zmp, key, value, who);
  }
  Status getZMP(const std::string& key, Vector3& value, const char* who = "user") const;
  /// Re-orthonormalised; refused if the matrix is further than 1e-3 from a rotation.
  Status setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who = "user");
  /// From roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll).
  Status setPelvisOrientation(double roll, double pitch, double yaw, const char* who = "user");
  /// A rotation, identity until set.
  Eigen::Matrix3d getPelvisOrientation() const;
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
    return Eigen::Map<const Eigen::VectorXd>(data() + signal.offset(), signal.size());
  }

  /// The numbers of a signal, writable: for the host and its motion controllers, which own the
  /// store. Unchecked; the host's final guard judges the result.
  Eigen::Map<Eigen::VectorXd> view(ControlSignal signal) {
    return Eigen::Map<Eigen::VectorXd>(data() + signal.offset(), signal.size());
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
    return Eigen::Map<Eigen::Matrix<double, N, 1>>(data() + handle.signal_.offset(), handle.size());
  }

  /// The whole buffer; offsets as in ControlSignal::offset().
  const double* data() const { return table_.data().data(); }
  /// The whole buffer, writable, for the host and the manager.
  double* data() { return table_.data().data(); }
  /// Number of doubles in the buffer.
  int dataSize() const { return static_cast<int>(table_.data().size()); }

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

  /// The row of a handle that find() made.
  const SignalTable::Entry& entryOf(ControlSignal signal) const {
    return table_.entries()[signal.index()];
  }

  /// Container and key of a handle, as `container/key`, for reports.
  std::string nameOfSignal(ControlSignal signal) const;

  /// Prints every signal of every container.
  void print(std::ostream& out) const;

 private:
  Status set(ControlContainer container, const std::string& key, const Values& value,
             const char* who);
  Status get(ControlContainer container, const std::string& key, Eigen::VectorXd& value,
             const char* who) const {
    return table_.get(groupOf(container), key, value, who);
  }
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> constant(ControlSignal signal) const {
    if (!signal.valid()) throw EmptyHandle("a control signal is read that was never fetched");
    return Eigen::Map<const Eigen::Matrix<double, N, 1>>(data() + signal.offset(), signal.size());
  }
  Status checkJoints(ControlContainer container, const std::string& key, int size,
                     const char* who) const;
  ControlSignal findSized(ControlContainer container, const std::string& key, int size) const;

  SignalTable table_;
  int joints_;
  double period_s_;
  ControlMode mode_ = ControlMode::Task;
};

}  // namespace ctrl_more
