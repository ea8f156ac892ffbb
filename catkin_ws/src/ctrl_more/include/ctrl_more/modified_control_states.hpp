#pragma once

#include <cmath>
#include <stdexcept>

#include <Eigen/Core>

#include "ctrl_more/control_states.hpp"
#include "ctrl_more/signal.hpp"

namespace ctrl_more {

/// Thrown when a controller uses a permission that is not its own. A fault: the manager undoes
/// the controller's writes and pauses it.
class UndeclaredWrite : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Thrown when a controller writes a vector of the wrong size. A fault.
class WrongSize : public std::length_error {
 public:
  using std::length_error::length_error;
};

/// The references as modified so far in this cycle, as one controller may touch them: everything
/// readable, writable only what it declared.
class ModifiedControlStates {
 public:
  /// A view for one controller.
  /// @param control the store; must outlive the view
  /// @param owner the controller's number, as in its permissions
  ModifiedControlStates(ControlStates& control, std::uint32_t owner)
      : control_(control), owner_(owner) {}

  /// The numbers of a signal, as left by the controllers before this one.
  Eigen::Map<const Eigen::VectorXd> view(ControlSignal signal) const {
    return static_cast<const ControlStates&>(control_).view(signal);
  }

  /// The numbers of a signal, writable.
  /// @throws UndeclaredWrite if the permission is empty or another controller's
  Eigen::Map<Eigen::VectorXd> operator[](ModifySignal signal) {
    check(signal);
    return control_.view(signal.signal_);
  }

  /// As operator[], for a size N checked when the permission was made.
  template <int N>
  Eigen::Map<Eigen::Matrix<double, N, 1>> at(ModifySignal signal) {
    check(signal);
    return control_.view<N>(signal.signal_);
  }

  /// Replaces a signal.
  /// @throws WrongSize, UndeclaredWrite
  template <typename Derived>
  void set(ModifySignal signal, const Eigen::MatrixBase<Derived>& value) {
    check(signal);
    if (value.size() != signal.size()) {
      throw WrongSize("value has another size than the declared signal");
    }
    control_.view(signal.signal_) = value;
  }

  /// The store, for reading.
  const ControlStates& states() const { return control_; }

 private:
  void check(ModifySignal signal) const {
    if (signal.owner_ != owner_) {
      throw UndeclaredWrite("the controller has no permission to modify this signal");
    }
  }

  ControlStates& control_;
  std::uint32_t owner_;
};

}  // namespace ctrl_more
