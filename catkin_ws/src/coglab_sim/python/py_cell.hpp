/// @file
/// Python interface of the cell, for the modules coglab_sim._cell and coglab_sim._virtual.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "coglab_sim/cell.hpp"

namespace coglab_sim::python {

namespace py = pybind11;

inline py::dict poseDict(const Pose& pose) {
  py::dict result;
  result["position"] = pose.position;
  result["rotation"] = Eigen::Vector4d(pose.rotation.coeffs());  // x y z w
  return result;
}

inline Pose makePose(const Vector3d& position, const Eigen::Vector4d& rotation) {
  return {position, Quaterniond(rotation[3], rotation[0], rotation[1], rotation[2]).normalized()};
}

/// @throws std::invalid_argument for an unknown name or a value that does not fit.
inline CellConfig configFrom(const std::string& urdf, const py::dict& parameters) {
  CellConfig config;
  config.urdf = urdf;
  for (const auto& [key, value] : parameters) {
    setCellParameter(config, py::cast<std::string>(key), py::cast<ParameterValue>(value));
  }
  return config;
}

/// States of the hand's five motors.
inline py::list motorList(const plant::Plant& plant) {
  py::list list;
  for (int i = 0; i < plant::kMotors; ++i) {
    const plant::MotorState& state = plant.motors().state(i);
    py::dict motor;
    motor["position"] = state.position;
    motor["tension"] = state.tension;
    motor["current"] = state.current;
    motor["effort"] = state.effort;
    motor["moving"] = state.moving;
    motor["locked"] = state.locked;
    list.append(motor);
  }
  return list;
}

/// The same states without names: (position, current, effort, moving, locked) of each motor.
inline py::list motorTuples(const plant::Plant& plant) {
  py::list list;
  for (int i = 0; i < plant::kMotors; ++i) {
    const plant::MotorState& state = plant.motors().state(i);
    list.append(
        py::make_tuple(state.position, state.current, state.effort, state.moving, state.locked));
  }
  return list;
}

/// Contact forces by the names of phalanges and palm.
inline py::dict touchDict(const plant::Plant& plant, const plant::Touch& touch) {
  const auto& phalanges = plant.config().hand.phalanges;
  py::dict result;
  for (std::size_t i = 0; i < touch.phalanges.size(); ++i)
    result[py::str(phalanges[i].name)] = touch.phalanges[i];
  result["palm"] = touch.palm;
  return result;
}

/// Defines Plant and Drives in the module.
void definePlant(py::module_& m);

/// Lockstep for Python: bytes in, bytes out; None if nothing is sent.
class PyCell {
 public:
  PyCell(const std::string& urdf, const py::dict& parameters)
      : own_(std::make_unique<Cell>(configFrom(urdf, parameters))), cell_(*own_) {}
  /// A view of a cell with another owner.
  explicit PyCell(Cell& cell) : cell_(cell) {}

  py::object step(const py::object& answer) {
    if (answer.is_none()) {
      cell_.step(nullptr, 0);
    } else {
      const std::string bytes = py::cast<py::bytes>(answer);
      cell_.step(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
    if (!cell_.sent()) return py::none();
    const MeasurementBytes& out = cell_.measurement();
    return py::bytes(reinterpret_cast<const char*>(out.data()), out.size());
  }

  py::dict truth() const {
    const CellTruth t = cell_.truth();
    py::dict result;
    result["time"] = t.time;
    result["object"] = poseDict(t.object);
    result["object_velocity"] = t.object_twist.linear;
    result["object_spin"] = t.object_twist.angular;
    result["human_hand"] = poseDict(t.human_hand);
    result["robot_hand"] = poseDict(t.robot_hand);
    result["hand_closure"] = t.hand_closure;
    result["palm_force"] = t.palm_force;
    result["touch_force"] = t.touch_force;
    result["human_force"] = t.human_force;
    result["robot_load_share"] = t.robot_load_share;
    result["human_load_share"] = t.human_load_share;
    result["held_by"] = t.held_by;
    result["dropped"] = t.dropped;
    result["position"] = t.position;
    result["velocity"] = t.velocity;
    result["set_point"] = t.set_point;
    result["external_torque"] = t.external_torque;
    return result;
  }

  /// The part of the truth that people and trackers can observe, without a dictionary.
  py::tuple view() const {
    const CellTruth t = cell_.truth();
    const auto rotation = [](const Pose& pose) { return Eigen::Vector4d(pose.rotation.coeffs()); };
    return py::make_tuple(t.robot_hand.position, rotation(t.robot_hand), t.hand_closure,
                          t.object.position, rotation(t.object), t.human_force,
                          t.human_hand.position, rotation(t.human_hand));
  }

  /// The part of the truth that decides about a handover, without a dictionary.
  py::tuple handover() const {
    const CellTruth t = cell_.truth();
    return py::make_tuple(t.held_by, t.dropped, t.touch_force.norm());
  }

  Cell& cell() { return cell_; }
  const Cell& cell() const { return cell_; }

 private:
  std::unique_ptr<Cell> own_;
  Cell& cell_;
};

}  // namespace coglab_sim::python
