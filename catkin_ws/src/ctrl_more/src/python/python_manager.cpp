#include "python_manager.hpp"

namespace ctrl_more::python {

PythonManager::PythonManager(std::string name, py::object object, py::object robot,
                             py::object control, Logger* logger)
    : name_(std::move(name)),
      logger_(logger),
      object_(std::move(object)),
      robot_(std::move(robot)),
      control_(std::move(control)) {
  if (!py::hasattr(object_, "update_stage")) {
    refuse("manager '" + name_ + "': its class " +
           py::type::of(object_).attr("__name__").cast<std::string>() +
           " has no method update_stage(self, stage, robot, control)");
  }
  stage_ = object_.attr("update_stage");
  if (py::hasattr(object_, "begin_cycle")) begin_ = object_.attr("begin_cycle");
  if (py::hasattr(object_, "end_cycle")) end_ = object_.attr("end_cycle");
}

PythonManager::~PythonManager() {
  py::object* const all[] = {&begin_, &stage_, &end_, &robot_, &control_, &object_};
  if (!Py_IsInitialized()) {
    for (py::object* each : all) each->release();
    return;
  }
  py::gil_scoped_acquire locked;
  for (py::object* each : all) *each = py::object();
}

template <typename Call>
void PythonManager::call(const py::object& method, Call&& call) noexcept {
  if (!method || !failure_.empty()) return;
  py::gil_scoped_acquire locked;
  try {
    call();
  } catch (py::error_already_set& error) {
    failure_ = shortText(error);  // runs Python, which would take the interrupt
    if (error.matches(PyExc_KeyboardInterrupt)) PyErr_SetInterrupt();
  } catch (const std::exception& error) {
    failure_ = error.what();
  }
  if (!failure_.empty()) logger_->log(LogLevel::Error, name_, "it is stopped: " + failure_);
}

void PythonManager::beginCycle(const Cycle& cycle) noexcept {
  call(begin_, [&] { begin_(cycle); });
}

void PythonManager::updateStage(Stage stage, const RobotStates&, ControlStates&) noexcept {
  call(stage_, [&] { stage_(nameOf(stage), robot_, control_); });
}

void PythonManager::endCycle() noexcept {
  call(end_, [&] { end_(); });
}

}  // namespace ctrl_more::python
