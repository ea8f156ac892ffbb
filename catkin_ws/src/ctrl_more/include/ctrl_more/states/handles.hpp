#pragma once

#include <cstddef>
#include <stdexcept>

#include <Eigen/Core>

#include "ctrl_more/states/signal.hpp"
#include "ctrl_more/states/signal_table.hpp"

namespace ctrl_more {

/// Named sizes for the handles below: `Modify<Pose>` is `Modify<7>`.
enum SignalSize : int {
  AnySize = Eigen::Dynamic,  ///< known only at run time
  Twist = 6,                 ///< linear, angular
  Wrench = 6,                ///< force, torque
  Pose = 7,                  ///< x y z, quaternion x y z w
};

/// Thrown when a controller uses a permission of another controller. This is a fault: the manager
/// undoes the controller's writes and pauses it.
class UndeclaredWrite : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Thrown when a controller uses a handle that it did not fetch in initialize(). This is a fault.
class EmptyHandle : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Thrown when a controller writes outside the numbers of a signal. This is a fault. The sentence
/// contains the signal, its size and the given size.
class WrongSize : public std::length_error {
 public:
  using std::length_error::length_error;
};

/// Throws WrongSize for `given` instead of `expected` numbers of a signal or a part of it.
/// `signal` null: the controller's state.
[[noreturn, gnu::cold]] void refuseSize(const SignalTable::Entry* signal, int expected, int given);

/// Throws WrongSize for an access to `count` numbers from `start` on, in a signal (or a part of it)
/// of `size` numbers.
[[noreturn, gnu::cold]] void refuseReach(const SignalTable::Entry* signal, int size,
                                         std::ptrdiff_t start, std::ptrdiff_t count);

/// Handle for reading a robot signal of N numbers: `robot.view(handle)`. Only Setup makes handles
/// that are not empty; it checks that the signal has N numbers.
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

/// Handle of a control signal of N numbers. A controller has constant stores and can only read with
/// it: `original.view(handle)`. The host can also write. Setup and ControlStates::find<N>() make
/// handles; they check that the signal has N numbers.
template <int N = AnySize>
class Reference {
 public:
  /// An empty handle; using it throws EmptyHandle.
  Reference() = default;
  /// The handle without the size, for queries.
  ControlSignal signal() const { return signal_; }
  /// Number of doubles.
  int size() const { return signal_.size(); }
  /// False for an empty handle.
  bool valid() const { return signal_.valid(); }

 private:
  friend class Setup;
  friend class ControlStates;
  explicit Reference(ControlSignal signal) : signal_(signal) {}
  ControlSignal signal_;
};

/// Permission of one controller to modify a control signal of N numbers: `modified[handle]`. Only
/// Setup issues it, for signals that the description declares as modified, and checks that the
/// signal has N numbers. Only its owner can use it. It also reads: `original.view(handle)`.
template <int N = AnySize>
class Modify {
 public:
  /// An empty permission; using it is a fault.
  Modify() = default;
  /// The handle of the signal without the permission, for queries.
  ControlSignal signal() const { return signal_; }
  /// Number of doubles.
  int size() const { return signal_.size(); }
  /// False for an empty permission.
  bool valid() const { return owner_ != 0; }

 private:
  friend class Setup;
  friend class ControlStates;
  friend class ModifiedControlStates;
  Modify(ControlSignal signal, std::uint32_t owner) : signal_(signal), owner_(owner) {}
  ControlSignal signal_;
  std::uint32_t owner_ = 0;
};

/// Writable view of N numbers, with bounds checks in every build. For reading it is a constant
/// Eigen vector. It is written by assignment, `+= -= *= /=`, single numbers and segments. The
/// compiler checks fixed sizes; other wrong sizes throw WrongSize. Eigen's other ways of writing
/// (`<<`, coeffRef, blocks, resize) do not compile or have no effect.
template <int N = AnySize>
class Numbers : public Eigen::Map<const Eigen::Matrix<double, N, 1>> {
  using Base = Eigen::Map<const Eigen::Matrix<double, N, 1>>;
  using Index = Eigen::Index;

 public:
  /// @param data first number
  /// @param size number of doubles; N if N is fixed
  /// @param signal signal of the numbers, for messages; null: the controller's state
  Numbers(double* data, int size, const SignalTable::Entry* signal = nullptr)
      : Base(data, size), begin_(data), signal_(signal) {}
  /// Another view of the same numbers.
  Numbers(const Numbers&) = default;

  /// Copies the numbers of another view of the same size.
  /// @throws WrongSize
  Numbers& operator=(const Numbers& other) { return *this = static_cast<const Base&>(other); }
  /// Copies a vector of the same size.
  /// @throws WrongSize
  template <typename Derived>
  Numbers& operator=(const Eigen::DenseBase<Derived>& value) {
    return fit(value), written() = value.derived(), *this;
  }
  /// Adds a vector of the same size.
  /// @throws WrongSize
  template <typename Derived>
  Numbers& operator+=(const Eigen::MatrixBase<Derived>& value) {
    return fit(value), written() += value.derived(), *this;
  }
  /// Subtracts a vector of the same size.
  /// @throws WrongSize
  template <typename Derived>
  Numbers& operator-=(const Eigen::MatrixBase<Derived>& value) {
    return fit(value), written() -= value.derived(), *this;
  }
  /// Multiplies every number.
  Numbers& operator*=(double factor) { return written() *= factor, *this; }
  /// Divides every number.
  Numbers& operator/=(double divisor) { return written() /= divisor, *this; }
  /// Sets every number to `value`.
  Numbers& setConstant(double value) { return written().setConstant(value), *this; }
  /// Sets every number to 0.
  Numbers& setZero() { return setConstant(0.0); }
  /// Deleted, because the count of the following numbers cannot be checked.
  template <typename Value>
  void operator<<(const Value&) = delete;

  /// One number.
  /// @throws WrongSize
  double& operator[](Index i) { return need(i, 1), begin_[i]; }
  /// One number.
  /// @throws WrongSize
  double operator[](Index i) const { return need(i, 1), begin_[i]; }
  /// One number.
  /// @throws WrongSize
  double& operator()(Index i) { return (*this)[i]; }
  /// One number.
  /// @throws WrongSize
  double operator()(Index i) const { return (*this)[i]; }

  /// The first M numbers.
  template <int M>
  Numbers<M> head() {
    return segment<M>(0);
  }
  /// The last M numbers.
  template <int M>
  Numbers<M> tail() {
    return segment<M>(this->size() - M);
  }
  /// M numbers from `start` on.
  /// @throws WrongSize
  template <int M>
  Numbers<M> segment(Index start) {
    static_assert(M >= 0 && (N == AnySize || M <= N), "the signal has fewer numbers");
    return need(start, M), Numbers<M>(begin_ + start, M, signal_);
  }
  /// The first `count` numbers.
  /// @throws WrongSize
  Numbers<> head(Index count) { return segment(0, count); }
  /// The last `count` numbers.
  /// @throws WrongSize
  Numbers<> tail(Index count) { return segment(this->size() - count, count); }
  /// `count` numbers from `start` on.
  /// @throws WrongSize
  Numbers<> segment(Index start, Index count) {
    return need(start, count), Numbers<>(begin_ + start, static_cast<int>(count), signal_);
  }

 private:
  Eigen::Map<Eigen::Matrix<double, N, 1>> written() {
    return Eigen::Map<Eigen::Matrix<double, N, 1>>(begin_, this->size());
  }
  template <typename Derived>
  void fit(const Eigen::DenseBase<Derived>& value) const {
    constexpr int rows = Derived::RowsAtCompileTime, columns = Derived::ColsAtCompileTime;
    static_assert(columns == 1 || columns == AnySize, "the numbers of a signal are a column");
    static_assert(N == AnySize || rows == AnySize || rows == N, "the signal has another size");
    if (value.rows() != this->size() || value.cols() != 1)
      refuseSize(signal_, static_cast<int>(this->size()), static_cast<int>(value.size()));
  }
  void need(Index start, Index count) const {
    if (start >= 0 && count >= 0 && start <= this->size() - count) return;
    refuseReach(signal_, static_cast<int>(this->size()), start, count);
  }

  double* begin_;
  const SignalTable::Entry* signal_;
};

}  // namespace ctrl_more
