#include "python_motion.hpp"

#include <cmath>
#include <stdexcept>
#include <vector>

namespace py = pybind11;
using namespace coglab_controllers;

namespace coglab_sim::python {
namespace {

constexpr double kMostJoints = 0.02;  // rad, largest distance of the first reference's joints
constexpr double kMostPalm = 0.01;    // m, the same for the palm's position
constexpr double kMostTurn = 0.05;    // rad, and for its orientation
constexpr std::size_t kShort = 150;   // letters of the Python message in the reason
constexpr double kUnitLength = 1e-3;  // largest error of a quaternion's length

template <int N>
Eigen::Matrix<double, N, 1> numbers(const py::handle& value, const char* name) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(value);
  if (!array || array.ndim() != 1 || array.shape(0) != N) {
    throw std::invalid_argument(std::string(name) + ": " + std::to_string(N) +
                                " numbers are expected");
  }
  const Eigen::Map<const Eigen::Matrix<double, N, 1>> result(array.data());
  if (!result.allFinite()) {
    throw std::invalid_argument(std::string(name) + ": a number is not finite");
  }
  return result;
}

Eigen::Matrix<double, 6, 1> joined(const Vector3& first, const Vector3& second) {
  Eigen::Matrix<double, 6, 1> both;
  both << first, second;
  return both;
}

/// A Python exception as "file.py:12: ValueError: text". The place is the last one in the user's
/// code: frames of coglab.control are omitted.
std::string inWords(const py::error_already_set& error) {
  const auto name = error.type().attr("__name__").cast<std::string>();
  const auto text = py::str(error.value()).cast<std::string>();
  std::string place;
  for (py::object trace = error.trace(); trace && !trace.is_none(); trace = trace.attr("tb_next")) {
    const auto file = trace.attr("tb_frame").attr("f_code").attr("co_filename").cast<std::string>();
    if (file.find("/coglab/control/") != std::string::npos || file.front() == '<') continue;
    place = file.substr(file.rfind('/') + 1) + ":" +
            std::to_string(trace.attr("tb_lineno").cast<int>()) + ": ";
  }
  return place + name + (text.empty() ? "" : ": " + text);
}

}  // namespace

void PythonMotion::configure(MotionConfiguration& configuration) {
  try {
    for (const py::handle& row : steps_.attr("arguments")()) {
      const auto [name, unit, fallback, low, high] =
          row.cast<std::tuple<std::string, std::string, double, double, double>>();
      configuration.argument(name, unit, fallback, low, high);
      ++arguments_;
    }
  } catch (const py::error_already_set& error) {
    throw std::runtime_error(inWords(error));
  }
}

void PythonMotion::start(const MotionStart<>& start) {
  state_ = MotionState::Running;
  reason_.clear();
  error_.clear();
  began_ = false;
  from_ = start.from;
  try {
    py::list values;
    for (std::size_t i = 0; i < arguments_; ++i) values.append(start.request[ArgumentIndex{i}]);
    steps_.attr("start")(values, from_.joints, from_.joint_velocity,
                         Eigen::Vector3d(from_.pose.position),
                         Eigen::Vector4d(from_.pose.orientation.coeffs()),
                         joined(from_.velocity, from_.angular_velocity));
  } catch (const py::error_already_set& error) {
    fail(inWords(error));
  } catch (const std::exception& error) {
    fail(error.what());
  }
}

void PythonMotion::computeReference(const MotionCycle& cycle, MotionReference& reference) {
  if (state_ == MotionState::Reached) return holdEnd(reference);
  if (state_ != MotionState::Running) return reference.rest();
  try {
    const py::object answer =
        steps_.attr("reference")(cycle.time, cycle.next, JointVector(cycle.input.robot.position));
    readReference(answer, cycle.next - cycle.time, reference);
    if (!began_) checkBegin(reference);
    began_ = true;
    if (steps_.attr("done")().cast<bool>()) {
      state_ = MotionState::Reached;
      end_ = reference;
    }
  } catch (const py::error_already_set& error) {
    reference.rest();
    fail(inWords(error));
  } catch (const std::exception& error) {
    reference.rest();
    fail(error.what());
  }
}

void PythonMotion::holdEnd(MotionReference& reference) const {
  if (end_.space == MotionReference::Space::Joint) {
    reference.joints(end_.joint_next, end_.joint_next);
  } else if (end_.space == MotionReference::Space::Pose) {
    const Pose at = end_.nextTool();
    reference.pose(at, at);
  }
}

void PythonMotion::readReference(const py::object& answer, double dt,
                                 MotionReference& reference) const {
  if (answer.is_none()) return reference.rest();
  const auto parts = answer.cast<py::tuple>();
  if (parts.size() == 2) {
    const JointVector now = numbers<7>(parts[0], "joints");
    return reference.joints(now, now + dt * numbers<7>(parts[1], "joint_velocity"));
  }
  if (parts.size() != 3) {
    throw std::invalid_argument(
        "a reference is None, (joints, joint_velocity) or (position, orientation, twist)");
  }
  const Eigen::Vector4d turn = numbers<4>(parts[1], "orientation");
  if (std::abs(turn.norm() - 1.0) > kUnitLength) {
    throw std::invalid_argument("orientation: a quaternion of length 1 is expected");
  }
  const auto twist = numbers<6>(parts[2], "twist");
  reference.cartesian({{numbers<3>(parts[0], "position"), Quaternion(turn).normalized()},
                       twist.head<3>(),
                       twist.tail<3>(),
                       true});
}

void PythonMotion::checkBegin(const MotionReference& reference) const {
  const auto away = [](double by, double most, const char* unit) {
    if (by <= most) return;
    throw std::invalid_argument("the first reference is " + std::to_string(by) + " " + unit +
                                " away from the set-point, at most " + std::to_string(most) +
                                " is expected: begin at start.set_point");
  };
  if (reference.space == MotionReference::Space::Joint) {
    away((reference.joint_position - from_.joints).cwiseAbs().maxCoeff(), kMostJoints, "rad");
  } else if (reference.space == MotionReference::Space::Pose) {
    away((reference.tool.pose.position - from_.pose.position).norm(), kMostPalm, "m");
    away(rotationBetween(from_.pose.orientation, reference.tool.pose.orientation).norm(), kMostTurn,
         "rad");
  }
}

void PythonMotion::fail(const std::string& what) {
  state_ = MotionState::Aborted;
  error_ = what;
  const std::string first = what.substr(0, what.find('\n'));
  reason_ = Reason(ReasonCode::ControllerFault, "the Python motion: ");
  reason_ << first.substr(0, kShort).c_str();
}

}  // namespace coglab_sim::python
