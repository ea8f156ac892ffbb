#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/handles.hpp"

namespace ctrl_more {

/// One controller's view of the references as modified so far in this cycle. The controller can
/// read all signals and write only those that it declared.
class ModifiedControlStates {
 public:
  /// A view for one controller.
  /// @param control the store; must outlive the view
  /// @param owner the controller's number, as in its permissions
  ModifiedControlStates(ControlStates& control, std::uint32_t owner)
      : control_(control), owner_(owner) {}

  /// The numbers of a signal after the controllers before this one.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Reference<N>& handle) const {
    return states().view(handle);
  }

  /// As above, for a signal that the controller modifies.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Modify<N>& handle) const {
    return states().view(handle);
  }

  /// The numbers of a signal, writable. Access outside them throws WrongSize.
  /// @throws UndeclaredWrite if the permission is empty or belongs to another controller
  template <int N>
  Numbers<N> operator[](const Modify<N>& handle) {
    if (handle.owner_ != owner_) refuse();
    return Numbers<N>(control_.data() + handle.signal_.offset(), handle.size(),
                      &control_.entryOf(handle.signal_));
  }

  /// Replaces a signal.
  /// @throws UndeclaredWrite as above, WrongSize if `value` has another size
  template <int N, typename Derived>
  void set(const Modify<N>& handle, const Eigen::MatrixBase<Derived>& value) {
    (*this)[handle] = value;
  }

  /// The store, for reading.
  const ControlStates& states() const { return control_; }

 private:
  [[noreturn, gnu::cold, gnu::noinline]] static void refuse() {
    throw UndeclaredWrite("the controller has no permission to modify this signal");
  }

  ControlStates& control_;
  std::uint32_t owner_;
};

}  // namespace ctrl_more
