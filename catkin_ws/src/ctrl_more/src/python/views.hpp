/// @file
/// Views of the stores for a Python controller during its update(). Arrays use the memory of the
/// stores. They are made once and kept as long as the stores do not move.
#pragma once

#include <string>
#include <unordered_map>

#include "bindings.hpp"

namespace ctrl_more::python {

/// Arrays by the address of their first number.
class Arrays {
 public:
  /// The array of `size` numbers that begins at `data`.
  py::array& on(const double* data, int size, const py::handle& owner, bool writable) {
    const auto found = arrays_.find(data);
    if (found != arrays_.end() && found->second.size() == size) return found->second;
    return arrays_[data] = arrayOn(data, size, owner, writable);
  }
  /// Makes all of them writable or read-only.
  void setAllWritable(bool writable) {
    for (auto& entry : arrays_) setWritable(entry.second, writable);
  }

 private:
  std::unordered_map<const double*, py::array> arrays_;
};

/// A store that Python may use only during update(), while `now` is set.
template <typename Store>
class During {
 public:
  Store* now = nullptr;  ///< null outside update()
  py::object owner;      ///< keeps the memory of the store

 protected:
  Store& states() const {
    if (!now)
      refuse("robot, original and modified can be used in update() alone; copy what must last");
    return *now;
  }
};

/// `robot` of update().
class RobotView : public During<const RobotStates> {
 public:
  using During::states;
  /// Read-only numbers of a signal.
  py::array view(const Read<>& handle) {
    const auto numbers = states().view(handle);
    return arrays_.on(numbers.data(), static_cast<int>(numbers.size()), owner, false);
  }

 private:
  Arrays arrays_;
};

/// `original` of update().
class ControlView : public During<const ControlStates> {
 public:
  /// Read-only numbers of a signal.
  template <typename Handle>
  py::array view(const Handle& handle) {
    const auto numbers = states().view(handle);
    return arrays_.on(numbers.data(), static_cast<int>(numbers.size()), owner, false);
  }

 private:
  Arrays arrays_;
};

/// `modified` of update().
class ModifiedView : public During<ModifiedControlStates> {
 public:
  /// Read-only numbers of a signal.
  template <typename Handle>
  py::array view(const Handle& handle) {
    const auto numbers = states().view(handle);
    return read_.on(numbers.data(), static_cast<int>(numbers.size()), owner, false);
  }
  /// Numbers of a signal, writable until update() returns.
  py::array at(const Modify<>& handle) {
    const auto numbers = states()[handle];
    return written_.on(numbers.data(), static_cast<int>(numbers.size()), owner, true);
  }
  /// Replaces a signal.
  void set(const Modify<>& handle, const py::object& value) {
    auto numbers = states()[handle];
    // `modified[handle] += x` has already written, and assigns the same array.
    if (py::isinstance<py::array>(value)) {
      const auto array = py::reinterpret_borrow<py::array>(value);
      if (array.data() == numbers.data() && array.size() == numbers.size()) return;
    }
    numbers = toVector(value, "a value of modified");
  }
  /// Makes the arrays of modified signals writable or read-only.
  void setAllWritable(bool writable) { written_.setAllWritable(writable); }

 private:
  Arrays read_, written_;
};

}  // namespace ctrl_more::python
