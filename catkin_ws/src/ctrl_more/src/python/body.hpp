/// @file
/// A feedback controller that is written in Python.
#pragma once

#include <memory>
#include <string>

#include "bindings.hpp"
#include "views.hpp"

namespace ctrl_more::python {

class Body;

/// Python's base class ctrl_more.FeedbackController. A manager runs its body. This object owns the
/// body until a manager takes it; the body then keeps this object alive.
class Script {
 public:
  Script();
  ~Script();
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;

  /// The controller; `self` is the Python object of this Script.
  Body& body(const py::object& self);
  /// Gives the body to a manager. Raises Refused if one has it already.
  static std::unique_ptr<FeedbackController> handOver(py::object self);

 private:
  friend class Body;
  std::unique_ptr<Body> own_;  // null while a manager has it
  Body* body_;
};

/// Calls the methods of a Python object. Takes Python's lock in every call, so a manager may run it
/// in a thread of C++.
class Body : public FeedbackController {
 public:
  explicit Body(Script* script) : script_(script) {}
  ~Body() override;

  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override;
  void gainsChanged() override;
  std::string judgeGains(const GainValues& gains) const override;
  void state(Numbers<> values) const override;

  /// Numbers of a gain.
  Eigen::VectorXd gainNow(Gain handle) const { return gain(handle); }
  /// Logs into the ring of the manager's logger.
  void write(const std::string& level, const std::string& text) const {
    log().write(toLevel(level), "", 0, text.c_str());
  }

 private:
  friend class Script;
  void cacheMethods();
  void openViews(const RobotStates& robot, const ControlStates& original,
                 ModifiedControlStates& modified);

  Script* script_;
  py::handle self_;  // the Python object
  py::object held_;  // the same, owned while a manager has the controller
  py::object update_, reset_, gains_changed_, state_;
  py::object robot_, original_, modified_;  // arguments of update(), made once
  RobotView* robot_view_ = nullptr;
  ControlView* original_view_ = nullptr;
  ModifiedView* modified_view_ = nullptr;
  const void *robot_store_ = nullptr, *original_store_ = nullptr, *control_store_ = nullptr;
};

}  // namespace ctrl_more::python
