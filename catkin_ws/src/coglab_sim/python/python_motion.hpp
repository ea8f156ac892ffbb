/// @file
/// A motion of the virtual robot whose reference comes from a Python object.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>

#include <string>

#include "coglab_controllers/motion/motion.hpp"

namespace coglab_sim::python {

/// Calls these methods of a Python object, all within tick(), which holds Python's lock:
///
/// - `arguments()`: returns [(name, unit, default, low, high)]
/// - `start(values, joints, joint_velocity, position, orientation, twist)`
/// - `reference(time, next, joints)`: returns None (the arm brakes and stands), or
///   (joints, joint_velocity), or (position, orientation, twist)
/// - `done()`: returns true when the reference has ended
///
/// Sizes and units as in coglab.control.Motion. An exception, a wrong size, a number that is not
/// finite, or a first reference away from the set-point ends the motion: the arm brakes. error()
/// then returns the whole Python message.
class PythonMotion : public coglab_controllers::Motion<> {
 public:
  explicit PythonMotion(pybind11::object steps) : steps_(std::move(steps)) {}

  void configure(coglab_controllers::MotionConfiguration& configuration) override;
  void start(const coglab_controllers::MotionStart<>& start) override;
  void computeReference(const coglab_controllers::MotionCycle& cycle,
                        coglab_controllers::MotionReference& reference) override;
  coglab_controllers::MotionState state() const override { return state_; }
  const coglab_controllers::Reason& reason() const override { return reason_; }

  /// The Python message of the last fault, with its traceback; empty: none.
  const std::string& error() const { return error_; }

 private:
  void fail(const std::string& what);
  /// Stays at the end of the last reference, until the arm arrives there too.
  void holdEnd(coglab_controllers::MotionReference& reference) const;
  void readReference(const pybind11::object& answer, double dt,
                     coglab_controllers::MotionReference& reference) const;
  void checkBegin(const coglab_controllers::MotionReference& reference) const;

  pybind11::object steps_;
  std::size_t arguments_ = 0;
  coglab_controllers::MotionState state_ = coglab_controllers::MotionState::Idle;
  coglab_controllers::Reason reason_;
  coglab_controllers::SetPoint from_;
  coglab_controllers::MotionReference end_;  // of the cycle in which done() was true
  bool began_ = false;                       // the first reference has been checked
  std::string error_;
};

}  // namespace coglab_sim::python
