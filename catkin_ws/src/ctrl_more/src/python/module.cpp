#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "bindings.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more::python {

py::object& refusedClass() {
  static auto* the_class = new py::object();  // never destroyed: Python may have ended before
  return *the_class;
}

std::string pathOf(const py::object& file) {
  return py::module_::import("os").attr("fspath")(file).cast<std::string>();
}

void refuse(const std::string& text, Cause cause) {
  static const char* const names[] = {"none", "invalid argument", "unknown name",
                                      "busy", "bad file",         "fault"};
  py::object error = refusedClass()(text);
  error.attr("cause") = names[static_cast<int>(cause)];
  PyErr_SetObject(refusedClass().ptr(), error.ptr());
  throw py::error_already_set();
}

Eigen::VectorXd toVector(const py::handle& value, const std::string& name) {
  const py::array array = py::array::ensure(value);
  if (!array) {
    PyErr_Clear();
    refuse(name + ": expected an array of numbers, got " +
           py::str(py::type::handle_of(value).attr("__name__")).cast<std::string>());
  }
  const char kind = array.dtype().kind();
  if (std::strchr("fiu", kind) == nullptr) {
    refuse(name + ": expected real numbers, got an array of " +
           py::str(array.dtype()).cast<std::string>());
  }
  if (array.ndim() > 1) {  // a bare number, also one of numpy, counts as an array of one
    refuse(name + ": expected an array of one dimension, got shape " +
           py::str(array.attr("shape")).cast<std::string>());
  }
  const auto numbers =
      py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!numbers) throw py::error_already_set();
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), numbers.size());
}

py::array arrayOn(const double* data, int size, const py::handle& owner, bool writable) {
  py::array array(py::dtype::of<double>(), {static_cast<py::ssize_t>(size)},
                  {static_cast<py::ssize_t>(sizeof(double))}, data, owner);
  setWritable(array, writable);
  return array;
}

void setWritable(py::array& array, bool writable) {
  int& flags = py::detail::array_proxy(array.ptr())->flags;
  const int bit = py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  flags = writable ? flags | bit : flags & ~bit;
}

namespace {

// Index of a text in a list of names, or Refused with the nearest one.
int indexIn(const char* what, const std::string& text, const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), text);
  if (found == names.end()) {
    refuse("there is no " + std::string(what) + " '" + text + "'" + suggestion(text, names),
           Cause::UnknownName);
  }
  return static_cast<int>(found - names.begin());
}

}  // namespace

ControlContainer toContainer(const std::string& text) {
  std::vector<std::string> names;
  for (int i = 0; i < kControlContainers; ++i)
    names.push_back(nameOf(static_cast<ControlContainer>(i)));
  return static_cast<ControlContainer>(indexIn("container", text, names));
}

RobotSource toSource(const std::string& text) {
  return static_cast<RobotSource>(
      indexIn("map of robot states", text, {"measuredData", "estimatedData"}));
}

Stage toStage(const std::string& text) {
  return static_cast<Stage>(indexIn("stage", text, {"task", "joint"}));
}

StopPolicy toPolicy(const std::string& text) {
  return static_cast<StopPolicy>(indexIn("policy", text, {"by kind", "hold", "fade", "zero"}));
}

LogLevel toLevel(const std::string& text) {
  return static_cast<LogLevel>(indexIn("level", text, {"debug", "info", "warning", "error"}));
}

std::string shortText(py::error_already_set& error) {
  std::string place, name = "error", text;
  try {
    name = error.type().attr("__name__").cast<std::string>();
    text = py::str(error.value()).cast<std::string>();
    py::object trace = error.trace();
    while (trace && !trace.is_none()) {
      const auto file =
          trace.attr("tb_frame").attr("f_code").attr("co_filename").cast<std::string>();
      place = file.substr(file.rfind('/') + 1) + ":" +
              std::to_string(trace.attr("tb_lineno").cast<int>()) + ": ";
      trace = trace.attr("tb_next");
    }
  } catch (py::error_already_set&) {  // an exception whose text cannot be made
  }
  return place + name + (text.empty() ? "" : ": " + text);
}

}  // namespace ctrl_more::python

PYBIND11_MODULE(_core, module) {
  using namespace ctrl_more;
  using namespace ctrl_more::python;
  module.doc() = "The library ctrl_more, as it runs in the robot's control cycle.";
  refusedClass() = py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(
      "ctrl_more.Refused",
      "A refused request. Its text contains the expected and the received "
      "value and what to do; nothing has changed.",
      PyExc_ValueError, nullptr));
  module.attr("Refused") = refusedClass();
  // The text of a compiled function is no attribute that Python may set; pybind11 replaces it in
  // the same way when it adds an overload, and frees it at the end.
  module.def("_set_doc", [](const py::function& function, const std::string& text) {
    const py::handle compiled = function.cpp_function();
    if (!compiled || !PyCFunction_Check(compiled.ptr())) return;
    const char*& doc = reinterpret_cast<PyCFunctionObject*>(compiled.ptr())->m_ml->ml_doc;
    std::free(const_cast<char*>(doc));
    doc = strdup(text.c_str());
  });
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const ConfigError& error) {
      PyErr_SetString(refusedClass().ptr(), error.what());
    } catch (const UndeclaredWrite& error) {
      PyErr_SetString(PyExc_PermissionError, error.what());
    }
  });
  module.attr("INTERFACE") = thisAbi().interface;
  bindLogger(module);
  bindStates(module);
  bindDescription(module);
  bindController(module);
  bindManager(module);
}
