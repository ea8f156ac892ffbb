#include <sstream>

#include "bindings.hpp"
#include "body.hpp"
#include "ctrl_more/central_module.hpp"
#include "python_manager.hpp"

namespace ctrl_more::python {
namespace {

using Feedback = FeedbackControllersManager;

/// A manager whose cycle Python runs. It stores its states, to refuse others.
class OwnManager : public Feedback {
 public:
  OwnManager(RobotStates& robot_states, ControlStates& control_states,
             const ManagerOptions& options, Logger* logger)
      : Feedback(robot_states, control_states, options, logger),
        robot(robot_states),
        control(control_states) {}
  RobotStates& robot;
  ControlStates& control;
};

OwnManager& ownCycle(Feedback& manager) {
  auto* own = dynamic_cast<OwnManager*>(&manager);
  if (!own) refuse("the cycle of this manager is run by the program that made it");
  return *own;
}

void requireStores(const OwnManager& manager, const RobotStates* robot,
                   const ControlStates* control) {
  if ((robot && robot != &manager.robot) || (control && control != &manager.control)) {
    refuse("a manager runs on the stores that it was made with; give it those, or none");
  }
}

LoadReport judged(LoadReport report, bool strict) {
  if (strict && !report.ok()) refuse(report.text(), Cause::BadFile);
  return report;
}

void bindRecords(py::module_& module) {
  py::class_<ControllerStatus>(module, "ControllerStatus", "State of one controller.")
      .def_readonly("name", &ControllerStatus::name)
      .def_readonly("type", &ControllerStatus::type)
      .def_property_readonly("stage", [](const ControllerStatus& s) { return nameOf(s.stage); })
      .def_readonly("enabled", &ControllerStatus::enabled)
      .def_readonly("paused", &ControllerStatus::paused)
      .def_readonly("safety", &ControllerStatus::safety)
      .def_readonly("reasons", &ControllerStatus::reasons)
      .def_property_readonly("activity",
                             [](const ControllerStatus& s) { return nameOf(s.activity); })
      .def_property_readonly("fault", [](const ControllerStatus& s) { return nameOf(s.fault); })
      .def_readonly("fault_text", &ControllerStatus::fault_text)
      .def_readonly("fault_cycle", &ControllerStatus::fault_cycle)
      .def_readonly("faults", &ControllerStatus::faults)
      .def_readonly("overruns", &ControllerStatus::overruns)
      .def_readonly("last_us", &ControllerStatus::last_us)
      .def_readonly("waiting_for", &ControllerStatus::waiting_for);
  py::class_<Attribution>(module, "Attribution", "Change of a reference by one controller.")
      .def_readonly("controller", &Attribution::controller)
      .def_readonly("signal", &Attribution::signal)
      .def_readonly("cycle", &Attribution::cycle)
      .def_readonly("before", &Attribution::before)
      .def_readonly("after", &Attribution::after)
      .def_readonly("size", &Attribution::size)
      .def_readonly("angle", &Attribution::angle);
  py::class_<CycleRecord>(module, "CycleRecord", "What each controller did in one cycle.")
      .def_readonly("cycle", &CycleRecord::cycle)
      .def_readonly("changes", &CycleRecord::changes)
      .def_property_readonly("states", [](const CycleRecord& r) {
        std::map<std::string, std::vector<double>> states;
        for (const ControllerState& state : r.states) states[state.controller] = state.values;
        return states;
      });
  py::class_<LoadReport>(module, "LoadReport", "Result of loading a list file.")
      .def_readonly("loaded", &LoadReport::loaded)
      .def_readonly("errors", &LoadReport::errors)
      .def("__bool__", &LoadReport::ok)
      .def("__str__", &LoadReport::text);

  py::class_<Change> change(module, "Change", "Steps that the cycle adopts together, or none.");
  const auto self = py::return_value_policy::reference_internal;
  change.def(py::init<>())
      .def("enable", &Change::enable, py::arg("name"), self)
      .def("disable", &Change::disable, py::arg("name"), py::arg("force") = false, self)
      .def("pause", &Change::pause, py::arg("name"), py::arg("reason") = "user",
           py::arg("force") = false, self)
      .def("resume", &Change::resume, py::arg("name"), py::arg("reason") = "user", self)
      .def("order", &Change::order, py::arg("names"), self)
      .def(
          "gains",
          [](Change& c, const std::string& name, const py::dict& gains) -> Change& {
            return c.gains(name, toGains(gains));
          },
          py::arg("name"), py::arg("gains"), self)
      .def("gain_file", &Change::gainFile, py::arg("name"), py::arg("file"), self)
      .def("profile", &Change::profile, py::arg("name"), self)
      .def("motion_switched", &Change::motionSwitched, self);
}

template <typename Class>
void bindLoading(Class& type) {
  type.def(
      "load",
      [](Feedback& m, const py::object& file, bool strict) {
        const std::string path = pathOf(file);
        LoadReport report;
        {
          py::gil_scoped_release unlocked;
          report = m.load(path, strict);
        }
        return judged(std::move(report), strict);
      },
      py::arg("file"), py::arg("strict") = true);
  type.def(
      "load_text",
      [](Feedback& m, const std::string& text, const py::object& folder, bool strict) {
        const std::string base = pathOf(folder);
        LoadReport report;
        {
          py::gil_scoped_release unlocked;
          report = m.load(ConfigNode::fromText(text, "text"), base, strict);
        }
        return judged(std::move(report), strict);
      },
      py::arg("text"), py::arg("folder") = ".", py::arg("strict") = true);
  const auto entry = [](const py::object& config_file, bool enabled, double overrun_us,
                        double blend_s, const std::string& on_fault) {
    ControllerEntry e;
    if (!config_file.is_none()) e.config_file = pathOf(config_file);
    e.enabled = enabled;
    e.overrun_us = overrun_us;
    e.blend_s = blend_s;
    e.on_fault = toPolicy(on_fault);
    return e;
  };
  both(
      type, "addController",
      [entry](Feedback& m, py::object controller, const std::string& name, bool enabled,
              const py::object& config_file, double overrun_us, double blend_s,
              const std::string& on_fault) {
        py::module_::import("ctrl_more._scripts")
            .attr("judge")(py::type::of(controller), py::type::of(controller).attr("__name__"));
        const ControllerEntry e = entry(config_file, enabled, overrun_us, blend_s, on_fault);
        auto body = Script::handOver(std::move(controller));
        return request([&] { return m.addController(std::move(body), name, e); });
      },
      py::arg("controller"), py::arg("name"), py::arg("enabled") = false,
      py::arg("config_file") = py::none(), py::arg("overrun_us") = 0.0, py::arg("blend_s") = -1.0,
      py::arg("on_fault") = "fade");
  both(
      type, "loadController",
      [entry](Feedback& m, const std::string& name, const std::string& controller,
              const std::string& library, bool enabled, const py::object& config_file,
              double overrun_us, double blend_s, const std::string& on_fault) {
        ControllerEntry e = entry(config_file, enabled, overrun_us, blend_s, on_fault);
        e.type = controller;
        e.library = library;
        return request([&] { return m.loadController(name, e); });
      },
      py::arg("name"), py::arg("type") = "", py::arg("library") = "", py::arg("enabled") = false,
      py::arg("config_file") = py::none(), py::arg("overrun_us") = 0.0, py::arg("blend_s") = -1.0,
      py::arg("on_fault") = "fade");
  type.def(
      "unload",
      [](Feedback& m, const std::string& name) { return request([&] { return m.unload(name); }); },
      py::arg("name"));
  both(
      type, "setProfile",
      [](Feedback& m, const std::string& profile, const std::vector<std::string>& names) {
        return request([&] { return m.setProfile(profile, names); });
      },
      py::arg("profile"), py::arg("controllers"));
}

template <typename Class>
void bindChanging(Class& type) {
  const auto change = [&](const char* name, auto method) {
    type.def(
        name,
        [method](Feedback& m, const Change& c) { return request([&] { return (m.*method)(c); }); },
        py::arg("change"));
  };
  change("apply", &Feedback::apply);
  change("prepare", &Feedback::prepare);
  both(
      type, "waitAdopted",
      [](Feedback& m, std::uint64_t generation, double timeout) {
        return m.waitAdopted(generation, timeout);
      },
      py::arg("generation"), py::arg("timeout"), py::call_guard<py::gil_scoped_release>());
  type.def(
      "withdraw",
      [](Feedback& m, std::uint64_t g) { return request([&] { return m.withdraw(g); }); },
      py::arg("generation"));
  type.def(
      "enable",
      [](Feedback& m, const std::string& n) { return request([&] { return m.enable(n); }); },
      py::arg("name") = "");
  type.def(
      "disable",
      [](Feedback& m, const std::string& n, bool force) {
        return request([&] { return m.disable(n, force); });
      },
      py::arg("name") = "", py::arg("force") = false);
  type.def(
      "pause",
      [](Feedback& m, const std::string& n, bool force) {
        return request([&] { return m.pause(n, force); });
      },
      py::arg("name") = "", py::arg("force") = false);
  type.def(
      "resume",
      [](Feedback& m, const std::string& n, const std::string& reason) {
        return request([&] { return m.resume(n, reason); });
      },
      py::arg("name") = "", py::arg("reason") = "user");
  const auto forced = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Feedback& m, const std::string& signal, bool force) {
          return request([&] { return (m.*method)(signal, force); });
        },
        py::arg("signal"), py::arg("force") = false);
  };
  forced("pauseAllUsingRobotState", &Feedback::pauseAllUsingRobotState);
  forced("pauseAllUsingControlState", &Feedback::pauseAllUsingControlState);
  forced("disableAllUsingRobotState", &Feedback::disableAllUsingRobotState);
  forced("disableAllUsingControlState", &Feedback::disableAllUsingControlState);
  const auto plain = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Feedback& m, const std::string& name) {
          return request([&] { return (m.*method)(name); });
        },
        py::arg("name"));
  };
  plain("resumeAllUsingRobotState", &Feedback::resumeAllUsingRobotState);
  plain("resumeAllUsingControlState", &Feedback::resumeAllUsingControlState);
  plain("reloadGains", &Feedback::reloadGains);
  both(
      type, "setExecutionOrder",
      [](Feedback& m, const std::vector<std::string>& names) {
        return request([&] { return m.setExecutionOrder(names); });
      },
      py::arg("names"));
  both(
      type, "applyProfile",
      [](Feedback& m, const std::string& profile, bool motion_switched) {
        return request([&] { return m.applyProfile(profile, motion_switched); });
      },
      py::arg("profile"), py::arg("motion_switched") = true);
  both(
      type, "loadGains",
      [](Feedback& m, const std::string& name, const py::object& file) {
        const std::string path = pathOf(file);
        return request([&] { return m.loadGains(name, path); });
      },
      py::arg("name"), py::arg("file"));
  both(
      type, "setGains",
      [](Feedback& m, const std::string& name, const py::dict& gains) {
        const auto values = toGains(gains);
        return request([&] { return m.setGains(name, values); });
      },
      py::arg("name"), py::arg("gains"));
}

template <typename Class>
void bindQueries(Class& type) {
  // Another thread may hold the lock of the list and wait for Python's.
  const py::call_guard<py::gil_scoped_release> unlocked_call;
  both(
      type, "isEnabled", [](const Feedback& m, const std::string& n) { return m.isEnabled(n); },
      py::arg("name"), unlocked_call);
  both(
      type, "isPaused", [](const Feedback& m, const std::string& n) { return m.isPaused(n); },
      py::arg("name"), unlocked_call);
  both(
      type, "getGains", [](const Feedback& m, const std::string& n) { return m.getGains(n).all(); },
      py::arg("name"), unlocked_call);
  type.def("__contains__", &Feedback::has, unlocked_call);
  both(type, "getControllersNames", &Feedback::getControllersNames, unlocked_call);
  both(type, "getExecutionOrder", &Feedback::getExecutionOrder, unlocked_call);
  both(type, "getProfiles", &Feedback::getProfiles, unlocked_call);
  both(type, "hasProfile", &Feedback::hasProfile, py::arg("profile"), unlocked_call);
  both(type, "getUsedRobotStates", &Feedback::getUsedRobotStates, py::arg("enabled_only") = false,
       unlocked_call);
  both(type, "getUsedControlStates", &Feedback::getUsedControlStates,
       py::arg("enabled_only") = false, unlocked_call);
  type.def("describe", &Feedback::describe, py::arg("name"), unlocked_call);
  type.def("status", &Feedback::status, py::arg("name"), unlocked_call);
  both(type, "statusAll", &Feedback::statusAll, unlocked_call);
  type.def(
      "plot",
      [](const Feedback& m, const std::string& name) {
        std::ostringstream out;
        name.empty() ? m.plotAll(out) : m.plot(name, out);
        return out.str();
      },
      py::arg("name") = "", unlocked_call);
  both(
      type, "plotAll",
      [](const Feedback& m) {
        std::ostringstream out;
        m.plotAll(out);
        return out.str();
      },
      unlocked_call);
  type.def("attribution", &Feedback::attribution, unlocked_call);
  both(type, "lastCycle", &Feedback::lastCycle, unlocked_call);
  type.def_property_readonly("name", [](const Feedback& m) { return m.name(); });
}

template <typename Class>
void bindCycle(Class& type) {
  type.def("freeze", &Feedback::freeze);
  both(
      type, "beginCycle", [](Feedback& m, const Cycle& c) { ownCycle(m).beginCycle(c); },
      py::arg("cycle"));
  both(
      type, "updateStage",
      [](Feedback& m, const std::string& stage, const RobotStates* robot, ControlStates* control) {
        OwnManager& own = ownCycle(m);
        requireStores(own, robot, control);
        own.updateStage(toStage(stage), own.robot, own.control);
      },
      py::arg("stage"), py::arg("robot") = nullptr, py::arg("control") = nullptr);
  both(type, "endCycle", [](Feedback& m) { ownCycle(m).endCycle(); });
  type.def(
      "update",
      [](Feedback& m, const Cycle& c, const RobotStates* robot, ControlStates* control) {
        OwnManager& own = ownCycle(m);
        requireStores(own, robot, control);
        own.update(c, own.robot, own.control);
      },
      py::arg("cycle"), py::arg("robot") = nullptr, py::arg("control") = nullptr);
  type.def(
      "update",
      [](Feedback& m, const RobotStates* robot, ControlStates* control) {
        OwnManager& own = ownCycle(m);
        requireStores(own, robot, control);
        own.Feedback::update(own.robot, &own.control);
      },
      py::arg("robot") = nullptr, py::arg("control") = nullptr);
}

// A block of a file as dict, list or text. Numbers are tried before texts.
py::object toPython(const ConfigNode& node) {
  switch (node.kind()) {
    case ConfigNode::Kind::Empty:
      return py::none();
    case ConfigNode::Kind::List: {
      py::list list;
      for (const ConfigNode& item : node.items()) list.append(toPython(item));
      return std::move(list);
    }
    case ConfigNode::Kind::Map: {
      py::dict map;
      for (const auto& entry : node.entries()) map[py::str(entry.first)] = toPython(entry.second);
      return std::move(map);
    }
    case ConfigNode::Kind::Scalar:
      break;
  }
  const std::string& text = node.text("value");
  if (text == "true" || text == "false") return py::bool_(text == "true");
  try {
    return py::float_(node.number("value"));
  } catch (const ConfigError&) {
    return py::str(text);
  }
}

bool registerManager(const std::string& type, const py::object& maker) {
  if (!PyCallable_Check(maker.ptr()))
    throw py::type_error("maker: expected a class or a function of name, block, robot and control");
  // Registered for the rest of the program, so the maker is never given back.
  const py::handle kept = py::object(maker).release();
  return CentralModule::registerManager(
      type,
      [kept](const std::string& name, const ConfigNode& block, RobotStates& robot,
             ControlStates& control, Logger* logger) -> std::unique_ptr<Manager> {
        py::gil_scoped_acquire locked;
        const auto reference = py::return_value_policy::reference;
        const py::object robot_states = py::cast(&robot, reference);
        const py::object control_states = py::cast(&control, reference);
        try {
          py::object made = kept(name, toPython(block), robot_states, control_states);
          return std::make_unique<PythonManager>(name, std::move(made), robot_states,
                                                 control_states, logger);
        } catch (py::error_already_set& error) {
          throw block.error("manager '" + name + "': " + shortText(error));
        }
      });
}

void requireNoFailure(CentralModule& central) {
  for (const std::string& name : central.managers()) {
    const auto* manager = dynamic_cast<const PythonManager*>(&central.manager(name));
    if (manager && !manager->failure().empty()) {
      throw std::runtime_error("manager '" + name + "' is stopped: " + manager->failure());
    }
  }
}

void bindCentral(py::module_& module) {
  py::class_<CentralModule> type(module, "CentralModule",
                                 "Runs managers in the order of its file.");
  const auto internal = py::return_value_policy::reference_internal;
  type.def(py::init([](const py::object& file, Logger* logger) {
             const std::string path = pathOf(file);
             Logger* const records = orPython(logger);
             py::gil_scoped_release unlocked;
             return std::make_unique<CentralModule>(path, records);
           }),
           py::arg("file"), py::arg("logger") = nullptr, py::keep_alive<1, 3>());
  both(type, "robotStates", &CentralModule::robotStates, internal);
  both(type, "controlStates", &CentralModule::controlStates, internal);
  both(type, "feedbackControllers", &CentralModule::feedbackControllers, internal);
  type.def(
      "manager",
      [](py::object self, const std::string& name) -> py::object {
        Manager& manager = self.cast<CentralModule&>().manager(name);
        if (auto* python = dynamic_cast<PythonManager*>(&manager)) return python->object();
        return py::cast(&manager, py::return_value_policy::reference_internal, self);
      },
      py::arg("name"));
  type.def("managers", &CentralModule::managers);
  both(type, "loadErrors", &CentralModule::loadErrors);
  type.def(
      "update",
      [](CentralModule& c, const Cycle& cycle) {
        c.update(cycle);
        requireNoFailure(c);
      },
      py::arg("cycle"));
  type.def("update", [](CentralModule& c) {
    c.update();
    requireNoFailure(c);
  });
  type.def(
      "update",
      [](CentralModule& c, const RobotStates& robot, ControlStates* control) {
        const Status status = python::accept(c.update(robot, control));
        requireNoFailure(c);
        return status;
      },
      py::arg("robot"), py::arg("control"));
  type.def("plot", [](const CentralModule& c) {
    std::ostringstream out;
    c.plot(out);
    return out.str();
  });
  type.def_static("register_manager", &registerManager, py::arg("type"), py::arg("maker"));
  type.def_static("registerManager", &registerManager, py::arg("type"), py::arg("maker"));
  module.def("register_manager", &registerManager, py::arg("type"), py::arg("maker"));
}

}  // namespace

void bindManager(py::module_& module) {
  bindRecords(module);
  py::class_<Manager>(module, "Manager", "A manager of a central module.")
      .def_property_readonly("name", [](const Manager& m) { return m.name(); });
  py::class_<Feedback, Manager> type(
      module, "FeedbackControllersManager",
      "Loads, orders, runs, pauses and guards feedback controllers.");
  type.def(py::init([](RobotStates& robot, ControlStates& control, double blend_s, bool timed,
                       bool lockstep, int overruns_to_pause, bool check_undeclared,
                       Logger* logger) -> std::unique_ptr<Feedback> {
             if (!(blend_s >= 0.0 && blend_s < 1e6))
               refuse("blend_s: expected 0 s or more, got " + std::to_string(blend_s));
             ManagerOptions options;
             options.blend_s = blend_s;
             options.timed = timed;
             options.lockstep = lockstep;
             options.overruns_to_pause = overruns_to_pause;
             options.check_undeclared = check_undeclared;
             return std::make_unique<OwnManager>(robot, control, options, orPython(logger));
           }),
           py::arg("robot"), py::arg("control"), py::kw_only(), py::arg("blend_s") = 0.2,
           py::arg("timed") = false, py::arg("lockstep") = false, py::arg("overruns_to_pause") = 5,
           py::arg("check_undeclared") = false, py::arg("logger") = nullptr, py::keep_alive<1, 2>(),
           py::keep_alive<1, 3>(), py::keep_alive<1, 9>());
  bindLoading(type);
  bindChanging(type);
  bindQueries(type);
  bindCycle(type);
  bindCentral(module);
}

}  // namespace ctrl_more::python
