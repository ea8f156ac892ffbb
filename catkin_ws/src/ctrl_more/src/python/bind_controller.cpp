#include <map>
#include <sstream>
#include <vector>

#include "bindings.hpp"
#include "body.hpp"
#include "ctrl_more/loading/script_loader.hpp"

namespace ctrl_more::python {
namespace {

using Gains = std::map<std::string, std::vector<double>>;

// Made by the Python file _scripts.py, which finds the module and checks the class.
std::unique_ptr<FeedbackController> makeFromFile(const std::string& type,
                                                 const std::string& folder) {
  py::gil_scoped_acquire locked;
  try {
    return Script::handOver(py::module_::import("ctrl_more._scripts").attr("make")(type, folder));
  } catch (py::error_already_set& error) {
    if (error.matches(refusedClass())) {
      throw std::runtime_error(py::str(error.value()).cast<std::string>());
    }
    throw std::runtime_error("type '" + type + "': " + shortText(error));
  }
}

void bindUses(py::module_& module) {
  py::class_<ResolvedRobotUse>(module, "ResolvedRobotUse", "A declared robot signal with its key.")
      .def_readonly("use", &ResolvedRobotUse::use)
      .def_readonly("key", &ResolvedRobotUse::key)
      .def_property_readonly("name", &ResolvedRobotUse::name);
  py::class_<ResolvedControlUse>(module, "ResolvedControlUse",
                                 "A declared control signal with its key.")
      .def_readonly("use", &ResolvedControlUse::use)
      .def_readonly("key", &ResolvedControlUse::key)
      .def_property_readonly("name", &ResolvedControlUse::name);
}

template <typename Type>
void bindTableOne(Type& type) {
  using Self = const py::object&;
  const auto request_of = [&](const char* paper, auto method) {
    both(type, paper, [method](Self self) {
      Body& body = self.cast<Script&>().body(self);
      return request([&] { return (body.*method)(); });
    });
  };
  request_of("enable", &FeedbackController::enable);
  request_of("disable", &FeedbackController::disable);
  request_of("pause", &FeedbackController::pause);
  request_of("resume", &FeedbackController::resume);
  const auto query = [&](const char* paper, auto method) {
    both(type, paper, [method](Self self) { return (self.cast<Script&>().body(self).*method)(); });
  };
  query("isEnabled", &FeedbackController::isEnabled);
  query("isPaused", &FeedbackController::isPaused);
  query("getName", &FeedbackController::getName);
  query("getInformation", &FeedbackController::getInformation);
  query("getGains", &FeedbackController::getGains);
  query("getUsedRobotStates", &FeedbackController::getUsedRobotStates);
  query("getUsedControlState", &FeedbackController::getUsedControlState);
  query("getUsedControlStates", &FeedbackController::getUsedControlStates);
  query("declaration", &FeedbackController::declaration);
  const auto named = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Self self, const std::string& name) {
          return accept((self.cast<Script&>().body(self).*method)(name));
        },
        py::arg("name"));
  };
  named("setName", &FeedbackController::setName);
  named("addUsedRobotState", &FeedbackController::addUsedRobotState);
  named("addUsedControlState", &FeedbackController::addUsedControlState);
  const auto asked = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Self self, const std::string& name) {
          Body& body = self.cast<Script&>().body(self);
          py::gil_scoped_release unlocked;
          return (body.*method)(name);
        },
        py::arg("name"));
  };
  asked("isUsingRobotState", &FeedbackController::isUsingRobotState);
  asked("isUsingControlState", &FeedbackController::isUsingControlState);
  both(
      type, "loadGains",
      [](Self self, const std::string& file) {
        Body& body = self.cast<Script&>().body(self);
        return request([&] { return body.loadGains(file); });
      },
      py::arg("file"));
  both(
      type, "setGains",
      [](Self self, const py::dict& gains) {
        Body& body = self.cast<Script&>().body(self);
        const Gains values = toGains(gains);
        return request([&] { return body.setGains(values); });
      },
      py::arg("gains"));
  type.def("plot", [](Self self) {
    Body& body = self.cast<Script&>().body(self);
    py::gil_scoped_release unlocked;
    std::ostringstream out;
    body.plot(out);
    return out.str();
  });
}

}  // namespace

Gains toGains(const py::dict& gains) {
  Gains values;
  for (const auto& entry : gains) {
    const auto name = entry.first.cast<std::string>();
    const bool one = PyFloat_Check(entry.second.ptr()) || PyLong_Check(entry.second.ptr());
    if (one) {
      values[name] = {entry.second.cast<double>()};
    } else {
      const Eigen::VectorXd v = toVector(entry.second, "gain " + name);
      values[name].assign(v.data(), v.data() + v.size());
    }
  }
  return values;
}

void bindController(py::module_& module) {
  bindUses(module);
  py::class_<Script> type(module, "FeedbackController",
                          "Base class of a feedback controller in Python.");
  type.def(py::init<>());
  type.attr("interface") = thisAbi().interface;
  const auto missing = [&](const char* name) {
    type.def(name, [name](const py::object& self, const py::args&) {
      PyErr_Format(PyExc_NotImplementedError, "%s has no method %s()", Py_TYPE(self.ptr())->tp_name,
                   name);
      throw py::error_already_set();
    });
  };
  missing("describe");
  missing("initialize");
  missing("update");
  type.def("reset", [](const py::object&) {});
  type.def("gains_changed", [](const py::object&) {});
  type.def("judge_gains", [](const py::object&, const py::object&) { return py::none(); });
  type.def("state", [](const py::object&) { return std::vector<double>(); });
  type.def(
      "gain",
      [](const py::object& self, const Gain& handle) {
        return self.cast<Script&>().body(self).gainNow(handle);
      },
      py::arg("handle"));
  type.def(
      "scalar",
      [](const py::object& self, const Gain& handle) {
        return self.cast<Script&>().body(self).gainNow(handle)[0];
      },
      py::arg("handle"));
  type.def(
      "log",
      [](const py::object& self, const std::string& level, const std::string& text) {
        self.cast<Script&>().body(self).write(level, text);
      },
      py::arg("level"), py::arg("text"));
  bindTableOne(type);

  module.def(
      "describe",
      [](const py::object& library, const std::string& controller) {
        const std::string path = pathOf(library);
        try {
          py::gil_scoped_release unlocked;
          const ControllerInstance instance = makeController(path, controller);
          return instance.controller->declaration();
        } catch (const std::runtime_error& error) {
          refuse(error.what());
        }
      },
      py::arg("library"), py::arg("type") = "");
  setScriptLoader(&makeFromFile);
}

}  // namespace ctrl_more::python
