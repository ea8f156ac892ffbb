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

/// References and control efforts. Motion controllers write them and feedback controllers modify
/// them (Ctrl-MORE paper, section IV-B).
///
/// Outside the cycle, every container of the paper has a set and get method by key. Inside the
/// cycle, signals are read and written by handle. ControlContainer lists the sizes. Poses must have
/// a unit quaternion (1e-6), and every number must be finite. A refused value leaves the signal
/// unchanged. A new key is logged once; after freeze() it is an error.
///
/// All signals share one contiguous buffer, so the state at the start of a stage ("original") is a
/// single copy.
///
/// Threads: one thread at a time.
class ControlStates {
 public:
  /// A store with only the well-known signals (com, momenta, zmp, pelvis).
  /// @param joints number of joints, the size of every jointSpaceReference (0: the first one that
  ///        is set decides)
  /// @param period_s control period [s], > 0
  /// @param logger logs new keys and wrong accesses; null: Logger::standard()
  explicit ControlStates(int joints = 0, double period_s = 0.005, Logger* logger = nullptr);

  /// @name Declaring keys (outside the cycle, before freeze())
  /// @{

  /// Declares a signal, or adds unit and frame to an existing signal of the same size.
  /// @param container container of the signal
  /// @param key name within the container, not empty
  /// @param size number of doubles; must equal the container's fixed size, if it has one
  /// @param unit SI unit or list of units
  /// @param frame frame of the numbers
  Status declare(ControlContainer container, const std::string& key, int size,
                 const std::string& unit = "", const std::string& frame = "");

  /// Forbids new keys from now on. Called by the manager before the first cycle.
  void freeze() { table_.freeze(); }

  /// True after freeze().
  bool frozen() const { return table_.frozen(); }
  /// @}

  /// @name The paper's accessors, by key (outside the cycle)
  /// Setters refuse wrong sizes, numbers that are not finite and quaternions that are not unit.
  /// Getters leave the output unchanged on failure. `who` is the caller's name in messages.
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
  /// One number per joint; key Position, Velocity or Torque.
  Status setJointSpaceReference(const std::string& type, const Values& value,
                                const char* who = "user") {
    return set(ControlContainer::JointSpaceReference, type, value, who);
  }
  Status getJointSpaceReference(const std::string& type, Eigen::VectorXd& value,
                                const char* who = "user") const {
    return get(ControlContainer::JointSpaceReference, type, value, who);
  }
  /// The first writer sets the size.
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
  /// Re-orthonormalised. Refused if the matrix differs from a rotation by more than 1e-3.
  Status setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who = "user");
  /// From roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll).
  Status setPelvisOrientation(double roll, double pitch, double yaw, const char* who = "user");
  /// A rotation; identity until it is set.
  Eigen::Matrix3d getPelvisOrientation() const;
  /// @}

  /// @name Access by handle (inside the cycle: no allocation, no lock)
  /// @{

  /// Handle of a key; invalid if the key does not exist (outside the cycle).
  ControlSignal find(ControlContainer container, const std::string& key) const;

  /// Handle of a key that has N numbers (outside the cycle).
  /// @throws std::invalid_argument if the key does not exist or has another size
  template <int N>
  Reference<N> find(ControlContainer container, const std::string& key) const {
    return Reference<N>(findSized(container, key, N));
  }

  /// The numbers of a signal.
  Eigen::Map<const Eigen::VectorXd> view(ControlSignal signal) const {
    return Eigen::Map<const Eigen::VectorXd>(data() + signal.offset(), signal.size());
  }

  /// The numbers of a signal, writable, for the host and its motion controllers, which own the
  /// store. They are not checked here; the host's final guard checks the result.
  Eigen::Map<Eigen::VectorXd> view(ControlSignal signal) {
    return Eigen::Map<Eigen::VectorXd>(data() + signal.offset(), signal.size());
  }

  /// The numbers of a signal whose size was checked when its handle was made.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Reference<N>& handle) const {
    return constant<N>(handle.signal_);
  }

  /// As above, by the permission to modify the signal.
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

  /// Number of joints; 0 until it is known.
  int joints() const { return joints_; }
  /// Control period [s].
  double controlPeriod() const { return period_s_; }
  /// Sets the control period [s]; refused unless 0 < period < 1.
  Status setControlPeriod(double period_s);

  /// Signals of one container, in order of declaration.
  std::vector<SignalInfo> signals(ControlContainer container) const;

  /// Table row of a handle from find().
  const SignalTable::Entry& entryOf(ControlSignal signal) const {
    return table_.entries()[signal.index()];
  }

  /// `container/key` of a handle, for reports.
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
};

}  // namespace ctrl_more
