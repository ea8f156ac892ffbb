#include <sstream>

#include "bindings.hpp"
#include "views.hpp"

namespace ctrl_more::python {
namespace {

template <typename T>
struct Type {
  using type = T;
};

template <typename Store>
std::string printed(const Store& store) {
  std::ostringstream out;
  store.print(out);
  return out.str();
}

template <typename Store>
void requireFrozen(const Store& store) {
  if (!store.frozen()) {
    refuse(
        "view(): the store may still move its numbers; call freeze() first, or read a copy with "
        "its get methods");
  }
}

RobotSignal findSignal(const RobotStates& store, RobotSource source, const std::string& key) {
  const RobotSignal signal = store.find(source, key);
  if (!signal.valid())
    refuse("there is no " + std::string(nameOf(source)) + "/" + key + "; declare it first",
           Cause::UnknownName);
  return signal;
}

ControlSignal findSignal(const ControlStates& store, ControlContainer container,
                         const std::string& key) {
  const ControlSignal signal = store.find(container, key);
  if (!signal.valid())
    refuse("there is no " + std::string(nameOf(container)) + "/" + key + "; declare it first",
           Cause::UnknownName);
  return signal;
}

void bindHandles(py::module_& module) {
  const auto handle = [&](auto type, const char* name, const char* text) {
    using T = typename decltype(type)::type;
    py::class_<T>(module, name, text)
        .def_property_readonly("size", &T::size)
        .def_property_readonly("valid", &T::valid);
  };
  handle(Type<RobotSignal>{}, "RobotSignal", "A robot signal, for the host.");
  handle(Type<ControlSignal>{}, "ControlSignal", "A control signal, for the host.");
  handle(Type<Read<>>{}, "Read", "Reads a robot signal: robot.view(handle).");
  handle(Type<Reference<>>{}, "Reference", "Reads a control signal: original.view(handle).");
  handle(Type<Modify<>>{}, "Modify", "Permission to modify a control signal: modified[handle].");

  py::class_<SignalInfo>(module, "SignalInfo", "Properties of one signal.")
      .def_readonly("key", &SignalInfo::key)
      .def_readonly("unit", &SignalInfo::unit)
      .def_readonly("frame", &SignalInfo::frame)
      .def_readonly("size", &SignalInfo::size);

  py::class_<Cycle>(module, "Cycle", "Time of one control cycle.")
      .def(py::init([](std::int64_t now_ns, double dt, std::uint64_t number) {
             if (!(dt > 0.0 && dt < 1e6))
               refuse("dt: expected seconds above 0, got " + std::to_string(dt));
             return Cycle{now_ns, dt, number};
           }),
           py::arg("now_ns") = 0, py::arg("dt") = 0.005, py::arg("number") = 0)
      .def_readonly("now_ns", &Cycle::now_ns)
      .def_readonly("dt", &Cycle::dt)
      .def_readonly("number", &Cycle::number);

  py::class_<Status>(module, "Status", "Outcome of a request that was accepted.")
      .def("__bool__", &Status::ok)
      .def_property_readonly("ok", &Status::ok)
      .def_property_readonly("message", &Status::message)
      .def_property_readonly("generation", &Status::generation)
      .def("__repr__", [](const Status& s) {
        return "Status(generation=" + std::to_string(s.generation()) +
               (s.message().empty() ? "" : ", '" + s.message() + "'") + ")";
      });
}

void bindRobot(py::module_& module) {
  using Store = RobotStates;
  py::class_<Store> type(module, "RobotStates", "Measured and estimated data of the robot.");
  type.def(py::init([](Logger* logger) { return std::make_unique<Store>(orPython(logger)); }),
           py::arg("logger") = nullptr, py::keep_alive<1, 2>());
  type.def(
      "declare",
      [](Store& s, const std::string& source, const std::string& key, int size,
         const std::string& unit, const std::string& frame) {
        return accept(s.declare(toSource(source), key, size, unit, frame));
      },
      py::arg("source"), py::arg("key"), py::arg("size"), py::arg("unit") = "",
      py::arg("frame") = "");
  type.def("freeze", &Store::freeze).def_property_readonly("frozen", &Store::frozen);
  const auto setter = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Store& s, const std::string& key, const py::object& value, std::int64_t stamp_ns) {
          return accept((s.*method)(key, toVector(value, key), stamp_ns, "user"));
        },
        py::arg("key"), py::arg("value"), py::arg("stamp_ns"));
  };
  setter("setMeasuredData", &Store::setMeasuredData);
  setter("setEstimatedData", &Store::setEstimatedData);
  const auto getter = [&](const char* data, const char* stamp, RobotSource source) {
    both(
        type, data,
        [source](const Store& s, const std::string& key) -> Eigen::VectorXd {
          return s.view(findSignal(s, source, key));
        },
        py::arg("key"));
    both(
        type, stamp,
        [source](const Store& s, const std::string& key) {
          return s.stamp(findSignal(s, source, key));
        },
        py::arg("key"));
  };
  getter("getMeasuredData", "getMeasurementTimeStamp", RobotSource::Measured);
  getter("getEstimatedData", "getEstimateTimeStamp", RobotSource::Estimated);
  const auto stamper = [&](const char* paper, auto method) {
    both(
        type, paper,
        [method](Store& s, const std::string& key, std::int64_t stamp_ns) {
          return accept((s.*method)(key, stamp_ns, "user"));
        },
        py::arg("key"), py::arg("stamp_ns"));
  };
  stamper("setMeasurementTimeStamp", &Store::setMeasurementTimeStamp);
  stamper("setEstimateTimeStamp", &Store::setEstimateTimeStamp);
  type.def(
      "find",
      [](const Store& s, const std::string& source, const std::string& key) {
        return findSignal(s, toSource(source), key);
      },
      py::arg("source"), py::arg("key"));
  type.def(
      "view",
      [](py::object self, const std::string& source, const std::string& key) {
        const auto& s = self.cast<const Store&>();
        requireFrozen(s);
        const auto numbers = s.view(findSignal(s, toSource(source), key));
        return arrayOn(numbers.data(), static_cast<int>(numbers.size()), self, false);
      },
      py::arg("source"), py::arg("key"));
  type.def(
      "signals",
      [](const Store& s, const std::string& source) { return s.signals(toSource(source)); },
      py::arg("source"));
  type.def_property_readonly("newest_stamp", &Store::newestStamp);
  type.def("__str__", &printed<Store>);

  py::class_<RobotView>(module, "RobotView", "Robot states of this cycle, for a controller.")
      .def("view", &RobotView::view, py::arg("handle"))
      .def(
          "stamp", [](const RobotView& v, const Read<>& h) { return v.states().stamp(h); },
          py::arg("handle"));
}

template <typename Type>
void bindControlAccessors(Type& type) {
  using Store = ControlStates;
  const auto keyed = [&](const char* set, const char* get, ControlContainer container,
                         auto method) {
    both(
        type, set,
        [method](Store& s, const std::string& key, const py::object& value) {
          return accept((s.*method)(key, toVector(value, key), "user"));
        },
        py::arg("key"), py::arg("value"));
    both(
        type, get,
        [container](const Store& s, const std::string& key) -> Eigen::VectorXd {
          return s.view(findSignal(s, container, key));
        },
        py::arg("key"));
  };
  using C = ControlContainer;
  keyed("setTaskSpaceReferencePose", "getTaskSpaceReferencePose", C::TaskSpaceReferencePose,
        &Store::setTaskSpaceReferencePose);
  keyed("setTaskSpaceReferenceVel", "getTaskSpaceReferenceVel", C::TaskSpaceReferenceVel,
        &Store::setTaskSpaceReferenceVel);
  keyed("setTaskSpaceReferenceAcc", "getTaskSpaceReferenceAcc", C::TaskSpaceReferenceAcc,
        &Store::setTaskSpaceReferenceAcc);
  keyed("setJointSpaceReference", "getJointSpaceReference", C::JointSpaceReference,
        &Store::setJointSpaceReference);
  keyed("setOtherReference", "getOtherReference", C::OtherReference, &Store::setOtherReference);

  const auto three = [&](const char* set, const char* get, auto setter, auto getter) {
    both(
        type, set,
        [setter, set](Store& s, const py::object& value) {
          const Eigen::VectorXd v = toVector(value, set);
          if (v.size() != 3)
            refuse(std::string(set) + ": expected 3 numbers, got " + std::to_string(v.size()));
          return accept((s.*setter)(v, "user"));
        },
        py::arg("value"));
    both(type, get, [getter](const Store& s) { return (s.*getter)(); });
  };
  three("setCoM", "getCoM", &Store::setCoM, &Store::getCoM);
  three("setCoMVelocity", "getCoMVelocity", &Store::setCoMVelocity, &Store::getCoMVelocity);
  three("setCoMAcceleration", "getCoMAcceleration", &Store::setCoMAcceleration,
        &Store::getCoMAcceleration);
  three("setLinearMomentum", "getLinearMomentum", &Store::setLinearMomentum,
        &Store::getLinearMomentum);
  three("setAngularMomentum", "getAngularMomentum", &Store::setAngularMomentum,
        &Store::getAngularMomentum);
  both(
      type, "setZMP",
      [](Store& s, const py::object& value, const std::string& key) {
        const Eigen::VectorXd v = toVector(value, "zmp");
        if (v.size() != 3) refuse("zmp: expected 3 numbers, got " + std::to_string(v.size()));
        return accept(s.setZMP(key, Eigen::Vector3d(v)));
      },
      py::arg("value"), py::arg("key") = "zmp");
  both(
      type, "getZMP",
      [](const Store& s, const std::string& key) -> Eigen::VectorXd {
        return s.view(findSignal(s, C::Zmp, key));
      },
      py::arg("key") = "zmp");
  both(
      type, "setPelvisOrientation",
      [](Store& s, const Eigen::Matrix3d& rotation) {
        return accept(s.setPelvisOrientation(rotation));
      },
      py::arg("rotation"));
  both(
      type, "setPelvisOrientation",
      [](Store& s, double roll, double pitch, double yaw) {
        return accept(s.setPelvisOrientation(roll, pitch, yaw));
      },
      py::arg("roll"), py::arg("pitch"), py::arg("yaw"));
  both(type, "getPelvisOrientation",
       [](const Store& s) -> Eigen::Matrix3d { return s.getPelvisOrientation(); });
}

void bindControl(py::module_& module) {
  using Store = ControlStates;
  py::class_<Store> type(module, "ControlStates",
                         "References; motions write and controllers modify them.");
  type.def(py::init([](int joints, double period, Logger* logger) {
             if (joints < 0) refuse("joints: expected 0 or more, got " + std::to_string(joints));
             if (!(period > 0.0 && period < 1.0))
               refuse("period: expected above 0 and below 1 s, got " + std::to_string(period));
             return std::make_unique<Store>(joints, period, orPython(logger));
           }),
           py::arg("joints") = 0, py::arg("period") = 0.005, py::arg("logger") = nullptr,
           py::keep_alive<1, 4>());
  type.def(
      "declare",
      [](Store& s, const std::string& container, const std::string& key, int size,
         const std::string& unit, const std::string& frame) {
        return accept(s.declare(toContainer(container), key, size, unit, frame));
      },
      py::arg("container"), py::arg("key"), py::arg("size"), py::arg("unit") = "",
      py::arg("frame") = "");
  type.def("freeze", &Store::freeze).def_property_readonly("frozen", &Store::frozen);
  bindControlAccessors(type);
  type.def(
      "find",
      [](const Store& s, const std::string& container, const std::string& key) {
        return findSignal(s, toContainer(container), key);
      },
      py::arg("container"), py::arg("key"));
  type.def(
      "view",
      [](py::object self, const std::string& container, const std::string& key) {
        auto& s = self.cast<Store&>();
        requireFrozen(s);
        auto numbers = s.view(findSignal(s, toContainer(container), key));
        return arrayOn(numbers.data(), static_cast<int>(numbers.size()), self, true);
      },
      py::arg("container"), py::arg("key"));
  type.def(
      "signals",
      [](const Store& s, const std::string& container) {
        return s.signals(toContainer(container));
      },
      py::arg("container"));
  type.def_property_readonly("joints", &Store::joints);
  type.def_property("period", &Store::controlPeriod,
                    [](Store& s, double period) { accept(s.setControlPeriod(period)); });
  type.def("__str__", &printed<Store>);

  py::class_<ControlView>(module, "ControlView",
                          "References before any feedback controller of the stage, read-only.")
      .def("view", &ControlView::view<Reference<>>, py::arg("handle"))
      .def("view", &ControlView::view<Modify<>>, py::arg("handle"));
  py::class_<ModifiedView>(module, "ModifiedControlStates",
                           "References after the controllers before this one.")
      .def("view", &ModifiedView::view<Reference<>>, py::arg("handle"))
      .def("view", &ModifiedView::view<Modify<>>, py::arg("handle"))
      .def("__getitem__", &ModifiedView::at, py::arg("handle"))
      .def("__setitem__", &ModifiedView::set, py::arg("handle"), py::arg("value"))
      .def("set", &ModifiedView::set, py::arg("handle"), py::arg("value"));
}

}  // namespace

void bindStates(py::module_& module) {
  bindHandles(module);
  bindRobot(module);
  bindControl(module);
}

}  // namespace ctrl_more::python
