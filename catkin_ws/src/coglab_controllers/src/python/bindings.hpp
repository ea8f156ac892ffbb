/// @file
/// Parts of the Python module coglab_controllers._core and what they share. Documentation of the
/// Python side, with shapes and units, is in src/coglab_controllers/_core.pyi.
#pragma once

#include <stdexcept>
#include <string>

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers::python {

namespace py = pybind11;

/// Quaternions are arrays x y z w in Python.
using QuaternionArray = Eigen::Vector4d;

inline QuaternionArray toArray(const Quaternion& q) { return q.coeffs(); }

/// @throws std::invalid_argument (ValueError) unless it is a unit quaternion.
inline Quaternion toQuaternion(const QuaternionArray& xyzw, const char* name = "quaternion") {
  const Quaternion q(xyzw);
  if (!isUnit(q))
    throw std::invalid_argument(std::string(name) + ": expected a unit quaternion x y z w");
  return q.normalized();
}

/// @throws std::invalid_argument (ValueError) unless all entries are finite.
template <typename Vector>
const Vector& requireFinite(const Vector& vector, const char* name) {
  if (!vector.allFinite())
    throw std::invalid_argument(std::string(name) + ": expected finite numbers");
  return vector;
}

/// @throws std::invalid_argument (ValueError) unless dt is finite and not negative.
inline double requireStep(double dt) {
  if (!(dt >= 0.0 && dt < 1e6))
    throw std::invalid_argument("dt: expected seconds, 0 or more, got " + std::to_string(dt));
  return dt;
}

void bindDmp(py::module_& module);
void bindMotion(py::module_& module);
void bindArm(py::module_& module);
void bindLimits(py::module_& module);

}  // namespace coglab_controllers::python
