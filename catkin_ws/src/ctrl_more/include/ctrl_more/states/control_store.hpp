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

/// References as the cycle and its host use them: a SignalTable with a key and a size for each
/// signal, and access by handle. ControlStates adds the accessors of the Ctrl-MORE paper.
///
/// All signals live in one contiguous buffer, so that the state at the start of a stage
/// ("original") is one copy.
///
/// Threads: one thread at a time.
class ControlStore {
 public:
  /// A store with the well-known signals (com, momenta, zmp, pelvis) and no others.
  /// @param joints number of joints; every jointSpaceReference has this size (0: the first one
  ///        that is set decides)
  /// @param period_s control period [s], > 0
  /// @param logger where new keys and wrong accesses are reported; null: Logger::standard()
  explicit ControlStore(int joints = 0, double period_s = 0.005, Logger* logger = nullptr);

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
  void copyValuesFrom(const ControlStore& other);
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

 protected:
  /// Writes a signal by its key, after the checks of SignalTable::set().
  Status set(ControlContainer container, const std::string& key,
             const Eigen::Ref<const Eigen::VectorXd>& value, const char* who);
  /// Reads a signal by its key; on failure `value` is untouched.
  Status get(ControlContainer container, const std::string& key, Eigen::VectorXd& value,
             const char* who) const {
    return table_.get(groupOf(container), key, value, who);
  }
  /// Reports a refusal on the logger and returns it.
  Status refuse(const std::string& text) const { return table_.refuse(text); }

 private:
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
