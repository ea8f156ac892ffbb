/// @file
/// Parts of the Python module ctrl_more._core and what they share. Documentation of the Python
/// side, with shapes and units, is in src/ctrl_more/_core.pyi.
#pragma once

#include <cctype>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "ctrl_more/feedback_controllers_manager.hpp"

namespace ctrl_more::python {

namespace py = pybind11;

/// The Python class ctrl_more.Refused, a ValueError.
py::object& refusedClass();

/// A path that Python gave as text or as os.PathLike.
std::string pathOf(const py::object& file);

/// Raises Refused with a sentence.
[[noreturn]] void refuse(const std::string& text, Cause cause = Cause::InvalidArgument);

/// Raises Refused for a failure, else returns the status.
inline Status accept(Status status) {
  if (!status) refuse(status.message(), status.cause());
  return status;
}

/// Runs a request without the lock of Python, because it may wait for another thread.
template <typename Request>
Status request(Request&& run) {
  Status status;
  {
    py::gil_scoped_release unlocked;
    status = run();
  }
  return accept(std::move(status));
}

/// One dimension of numbers as doubles; other shapes and types raise Refused.
/// @param value any Python object
/// @param name its name for messages
Eigen::VectorXd toVector(const py::handle& value, const std::string& name);

/// Gains by name from numbers, lists or arrays.
std::map<std::string, std::vector<double>> toGains(const py::dict& gains);

/// An array on the memory of a store, without a copy.
/// @param data first number
/// @param size count of numbers
/// @param owner object that keeps the memory
/// @param writable false: the array is read-only
py::array arrayOn(const double* data, int size, const py::handle& owner, bool writable);

/// Sets whether an array can be written.
void setWritable(py::array& array, bool writable);

/// Containers, sources, stages and policies are texts in Python.
ControlContainer toContainer(const std::string& text);
RobotSource toSource(const std::string& text);
Stage toStage(const std::string& text);
StopPolicy toPolicy(const std::string& text);
LogLevel toLevel(const std::string& text);

/// The last line of a Python error and its place: `file.py:12: ValueError: text`.
std::string shortText(py::error_already_set& error);

/// Default logger of objects; it writes to Python's `logging`.
Logger& pythonLogger();
inline Logger* orPython(Logger* logger) { return logger ? logger : &pythonLogger(); }

/// `setTaskSpaceReferencePose` as `set_task_space_reference_pose`.
inline std::string snake(const std::string& paper) {
  const auto is = [&](int (*kind)(int), std::size_t i) {
    return i < paper.size() && kind(static_cast<unsigned char>(paper[i])) != 0;
  };
  std::string name;
  for (std::size_t i = 0; i < paper.size(); ++i) {
    const bool begins = i > 0 && (is(std::islower, i - 1) || is(std::islower, i + 1));
    // CoM is one word.
    const bool in_word = i >= 2 && paper.compare(i - 2, 3, "CoM") == 0;
    if (is(std::isupper, i) && begins && !in_word) name += '_';
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(paper[i])));
  }
  return name;
}

/// Defines a method under its paper name and under its Python name.
template <typename Class, typename Function, typename... Extra>
void both(Class& type, const char* paper, Function function, const Extra&... extra) {
  type.def(snake(paper).c_str(), function, extra...);
  if (snake(paper) != paper) type.def(paper, function, extra...);
}

void bindStates(py::module_& module);
void bindDescription(py::module_& module);
void bindController(py::module_& module);
void bindManager(py::module_& module);
void bindLogger(py::module_& module);

}  // namespace ctrl_more::python
