#pragma once

#include <stdexcept>

#include <Eigen/Core>

#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

/// Sizes that have a name, for the handles below: `Modify<Pose>` is `Modify<7>`.
enum SignalSize : int {
  AnySize = Eigen::Dynamic,  ///< known at run time only
  Twist = 6,                 ///< linear, angular
  Wrench = 6,                ///< force, torque
  Pose = 7,                  ///< x y z, quaternion x y z w
};

/// Thrown when a controller uses a permission that is not its own. A fault: the manager undoes
/// the controller's writes and pauses it.
class UndeclaredWrite : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Thrown when a handle is used that initialize() never fetched. A fault in a controller.
class EmptyHandle : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Thrown when a controller writes beside the numbers of a signal. A fault.
class WrongSize : public std::length_error {
 public:
  using std::length_error::length_error;
};

/// Handle of a robot signal of N numbers, for reading: `robot.view(handle)`. Only Setup makes one
/// that is not empty, and has compared N with the signal's size then.
template <int N = AnySize>
class Read {
 public:
  /// An empty handle; using it throws EmptyHandle.
  Read() = default;
  /// Number of doubles.
  int size() const { return signal_.size(); }
  /// False for an empty handle.
  bool valid() const { return signal_.valid(); }

 private:
  friend class Setup;
  friend class RobotStates;
  explicit Read(RobotSignal signal) : signal_(signal) {}
  RobotSignal signal_;
};

/// Handle of a control signal of N numbers. A controller only sees constant stores, so for it this
/// handle reads: `original.view(handle)`; the host may write by it. Setup and
/// ControlStore::find<N>() make one, and have compared N with the signal's size then.
template <int N = AnySize>
class Reference {
 public:
  /// An empty handle; using it throws EmptyHandle.
  Reference() = default;
  /// The same without its size, for questions.
  ControlSignal signal() const { return signal_; }
  /// Number of doubles.
  int size() const { return signal_.size(); }
  /// False for an empty handle.
  bool valid() const { return signal_.valid(); }

 private:
  friend class Setup;
  friend class ControlStore;
  explicit Reference(ControlSignal signal) : signal_(signal) {}
  ControlSignal signal_;
};

/// Permission of one controller to modify a control signal of N numbers: `modified[handle]`. Only
/// Setup issues it, only for a signal that the controller's description declares as modified, after
/// comparing N with its size; only its owner can use it. It reads as well: `original.view(handle)`.
template <int N = AnySize>
class Modify {
 public:
  /// An empty permission; using it is a fault.
  Modify() = default;
  /// The same signal without permission, for questions.
  ControlSignal signal() const { return signal_; }
  /// Number of doubles.
  int size() const { return signal_.size(); }
  /// False for an empty permission.
  bool valid() const { return owner_ != 0; }

 private:
  friend class Setup;
  friend class ControlStore;
  friend class ModifiedControlStates;
  Modify(ControlSignal signal, std::uint32_t owner) : signal_(signal), owner_(owner) {}
  ControlSignal signal_;
  std::uint32_t owner_ = 0;
};

/// N numbers that may be written, and none beside them: an Eigen vector whose elements and parts
/// are checked in every build. What lies outside throws WrongSize.
template <int N = AnySize>
class Numbers : public Eigen::Map<Eigen::Matrix<double, N, 1>> {
  using Base = Eigen::Map<Eigen::Matrix<double, N, 1>>;
  using Index = Eigen::Index;

 public:
  /// @param data first number
  /// @param size how many there are; N if that is fixed
  Numbers(double* data, int size) : Base(data, size) {}
  using Base::operator=;
  /// Copies the numbers of another view of the same size.
  Numbers& operator=(const Numbers& other) {
    Base::operator=(other);
    return *this;
  }
  /// Another view of the same numbers.
  Numbers(const Numbers&) = default;

  /// One number.
  double& operator[](Index i) { return need(i, 1), this->coeffRef(i); }
  /// One number.
  double operator[](Index i) const { return need(i, 1), this->coeff(i); }
  /// One number.
  double& operator()(Index i) { return (*this)[i]; }
  /// One number.
  double operator()(Index i) const { return (*this)[i]; }

  /// The first M numbers.
  template <int M>
  auto head() {
    return need<M>(0), Base::template head<M>();
  }
  /// The last M numbers.
  template <int M>
  auto tail() {
    return need<M>(0), Base::template tail<M>();
  }
  /// M numbers from `start` on.
  template <int M>
  auto segment(Index start) {
    return need(start, M), Base::template segment<M>(start);
  }
  /// The first `count` numbers.
  auto head(Index count) { return need(0, count), Base::head(count); }
  /// The last `count` numbers.
  auto tail(Index count) { return need(0, count), Base::tail(count); }
  /// `count` numbers from `start` on.
  auto segment(Index start, Index count) { return need(start, count), Base::segment(start, count); }

 private:
  template <int M>
  void need(Index start) const {
    static_assert(N == AnySize || M <= N, "the signal has fewer numbers");
    if constexpr (N == AnySize) need(start, M);
  }
  void need(Index start, Index count) const {
    if (start >= 0 && count >= 0 && start <= this->size() - count) return;
    outside();
  }
  [[noreturn, gnu::cold, gnu::noinline]] static void outside() {
    throw WrongSize("it reached beside the numbers of a signal");
  }
};

}  // namespace ctrl_more
