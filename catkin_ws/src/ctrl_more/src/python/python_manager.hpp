/// @file
/// A manager of a central module that is written in Python.
#pragma once

#include <exception>
#include <string>

#include "bindings.hpp"

namespace ctrl_more::python {

/// Calls begin_cycle(), update_stage() and end_cycle() of a Python object, if it has them. After an
/// exception it is not called again; CentralModule.update() raises that exception in Python.
class PythonManager : public Manager {
 public:
  PythonManager(std::string name, py::object object, py::object robot, py::object control,
                Logger* logger);
  ~PythonManager() override;

  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle& cycle) noexcept override;
  void updateStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept override;
  void endCycle() noexcept override;

  /// The Python object.
  const py::object& object() const { return object_; }
  /// The exception of this manager in words, "" if there is none.
  const std::string& failure() const { return failure_; }

 private:
  template <typename Call>
  void call(const py::object& method, Call&& call) noexcept;

  std::string name_, failure_;
  Logger* logger_;
  py::object object_, robot_, control_, begin_, stage_, end_;
};

}  // namespace ctrl_more::python
