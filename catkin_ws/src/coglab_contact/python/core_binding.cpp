/// Python module coglab_contact._core. Documentation of the Python side is in _core.pyi.
#include <pybind11/eigen.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <utility>

#include "coglab_contact/contact_detector.hpp"
#include "coglab_contact/evidence.hpp"
#include "coglab_contact/moving_contact.hpp"
#include "coglab_controllers/kinematics/chain.hpp"
#include "coglab_controllers/kinematics/dynamics.hpp"

namespace py = pybind11;
using namespace coglab_contact;

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Seven numbers; none if there are not seven.
std::optional<Joints> sevenOf(const Numbers& numbers) {
  if (numbers.ndim() != 1 || numbers.shape(0) != 7) return std::nullopt;
  return Joints(Eigen::Map<const Joints>(numbers.data()));
}

Joints joints(const Numbers& numbers, const char* name) {
  if (const auto seven = sevenOf(numbers)) return *seven;
  throw std::invalid_argument(std::string(name) + ": expected seven numbers, one per joint");
}

/// coglab_controllers.ArmDynamics.
class DescribedArm final : public ArmModel {
 public:
  explicit DescribedArm(const py::object& owner)
      : owner_(owner), dynamics_(owner.cast<coglab_controllers::ArmDynamics&>()) {}
  ArmTerms at(const Joints& q, const Joints& velocity) override {
    const coglab_controllers::DynamicTerms terms = dynamics_.evaluate(q, velocity);
    return {terms.momentum, terms.transposed, terms.gravity};
  }
  void setPayload(double mass, const Vector3& centre) override {
    dynamics_.setPayload(mass, centre);
  }

 private:
  py::object owner_;
  coglab_controllers::ArmDynamics& dynamics_;
};

/// A model in Python with the same methods.
class ScriptedArm final : public ArmModel {
 public:
  explicit ScriptedArm(py::object model) : model_(std::move(model)) {}
  ArmTerms at(const Joints& q, const Joints& velocity) override {
    const py::object terms = model_.attr("evaluate")(q, velocity);
    return {terms.attr("momentum").cast<Joints>(), terms.attr("transposed").cast<Joints>(),
            terms.attr("gravity").cast<Joints>()};
  }
  void setPayload(double mass, const Vector3& centre) override {
    model_.attr("set_payload")(mass, centre);
  }

 private:
  py::object model_;
};

std::shared_ptr<ArmModel> modelOf(const py::object& model) {
  if (py::isinstance<coglab_controllers::ArmDynamics>(model))
    return std::make_shared<DescribedArm>(model);
  return std::make_shared<ScriptedArm>(model);
}

/// From a coglab_controllers.Chain, else from a function in Python.
JacobianAt jacobianOf(const py::object& source) {
  if (py::isinstance<coglab_controllers::Chain>(source)) {
    const auto* chain = source.cast<const coglab_controllers::Chain*>();
    return [source, chain](const Joints& q) -> PalmJacobian {
      return chain->evaluate(q).jacobian.topRows<3>();
    };
  }
  return [source](const Joints& q) { return source(q).cast<PalmJacobian>(); };
}

/// The fields of Python's settings by their names.
DetectorSettings settingsOf(const py::object& settings) {
  const auto number = [&](const char* name) { return settings.attr(name).cast<double>(); };
  const auto count = [&](const char* name) { return settings.attr(name).cast<int>(); };
  return {number("cutoff"),
          number("window"),
          number("still_speed"),
          number("settle"),
          number("k"),
          count("confirm"),
          count("learn_samples"),
          number("floor"),
          number("offset_threshold"),
          number("sensitivity_share"),
          number("load_share"),
          number("release_confirm"),
          number("load_confirm"),
          settings.attr("user_direction").cast<Vector3>()};
}

void bindEvidence(py::module_& module) {
  module.attr("DECIDED") = kDecided;
  module.def("probability", &probability, py::arg("margin"));
  py::class_<Evidence>(module, "Evidence")
      .def(py::init([](std::string source, double stamp, double until, double margin,
                       std::string message) {
             return Evidence{std::move(source), stamp, until, margin, std::move(message)};
           }),
           py::arg("source"), py::arg("stamp"), py::arg("until"), py::arg("margin"),
           py::arg("message") = "")
      .def_readonly("source", &Evidence::source)
      .def_readonly("stamp", &Evidence::stamp)
      .def_readonly("until", &Evidence::until)
      .def_readonly("margin", &Evidence::margin)
      .def_readonly("message", &Evidence::message)
      .def_property_readonly("probability",
                             [](const Evidence& each) { return probability(each.margin); });
  py::class_<ContactEvent>(module, "ContactEvent")
      .def(py::init([](bool contact, std::string source, double margin, std::string message,
                       double confidence, int code) {
             return ContactEvent{contact, std::move(source), margin, std::move(message), confidence,
                                 code};
           }),
           py::arg("contact"), py::arg("source"), py::arg("margin"), py::arg("message") = "",
           py::arg("confidence") = 1.0, py::arg("code") = 0)
      .def_readonly("contact", &ContactEvent::contact)
      .def_readonly("source", &ContactEvent::source)
      .def_readonly("margin", &ContactEvent::margin)
      .def_readonly("message", &ContactEvent::message)
      .def_readonly("confidence", &ContactEvent::confidence)
      .def_readonly("code", &ContactEvent::code)
      .def(py::self == py::self)
      .def("__repr__", [](const ContactEvent& e) {
        return py::str(
                   "ContactEvent(contact={}, source={!r}, margin={}, message={!r}, "
                   "confidence={}, code={})")
            .format(e.contact, e.source, e.margin, e.message, e.confidence, e.code);
      });
}

void bindObserver(py::module_& module) {
  py::class_<Residual>(module, "Residual")
      .def_readonly("stamp", &Residual::stamp)
      .def_readonly("torque", &Residual::torque)
      .def_readonly("position", &Residual::position)
      .def_readonly("velocity", &Residual::velocity)
      .def_readonly("acceleration", &Residual::acceleration)
      .def_readonly("rate", &Residual::rate)
      .def_readonly("fresh", &Residual::fresh);
  py::class_<MomentumObserver>(module, "MomentumObserver")
      .def(py::init([](const py::object& dynamics, double gain, double period) {
             return std::make_unique<MomentumObserver>(modelOf(dynamics), gain, period);
           }),
           py::arg("dynamics"), py::arg("gain") = 40.0, py::arg("period") = 0.0)
      .def_readonly("gain", &MomentumObserver::gain)
      .def_readwrite("period", &MomentumObserver::period)
      .def_readwrite("lag", &MomentumObserver::lag)
      .def("reset", &MomentumObserver::reset)
      .def("set_payload", &MomentumObserver::setPayload, py::arg("mass"), py::arg("centre"))
      .def(
          "feed",
          [](MomentumObserver& observer, double stamp, const Numbers& position,
             const Numbers& torque, std::optional<double> made) {
            return observer.feed(stamp, joints(position, "position"), joints(torque, "torque"),
                                 made);
          },
          py::arg("stamp"), py::arg("position"), py::arg("torque"), py::arg("made") = py::none());
}

void bindThresholds(py::module_& module) {
  module.attr("VARIANCE_FLOOR") = kVarianceFloor;
  py::class_<Change>(module, "Change")
      .def(py::init([](double stamp, const Joints& torque, const Features& features,
                       const Joints& rate, const Joints& position, const PalmJacobian& jacobian) {
             return Change{stamp, torque, features, rate, position, jacobian};
           }),
           py::arg("stamp"), py::arg("torque"), py::arg("features"), py::arg("rate"),
           py::arg("position"), py::arg("jacobian"))
      .def_readonly("stamp", &Change::stamp)
      .def_readonly("torque", &Change::torque)
      .def_readonly("features", &Change::features)
      .def_readonly("rate", &Change::rate)
      .def_readonly("position", &Change::position)
      .def_readonly("jacobian", &Change::jacobian);
  py::class_<Offset>(module, "Offset")
      .def(py::init([](const Joints& torque, const PalmJacobian& jacobian) {
             return Offset{torque, jacobian};
           }),
           py::arg("torque"), py::arg("jacobian"))
      .def_readonly("torque", &Offset::torque)
      .def_readonly("jacobian", &Offset::jacobian);
  module.def(
      "explained",
      [](const Joints& torque, const Joints& deviation, const PalmJacobian& jacobian) {
        const PalmForce found = explained(torque, deviation, jacobian);
        return std::make_pair(found.force, found.size);
      },
      py::arg("torque"), py::arg("deviation"), py::arg("jacobian"));
}

void bindMovingContact(py::module_& module) {
  py::class_<MovingContact>(module, "MovingContact")
      .def(py::init([](const py::object& dynamics, const py::object& jacobian, double period) {
             return std::make_unique<MovingContact>(modelOf(dynamics), jacobianOf(jacobian),
                                                    period);
           }),
           py::arg("dynamics"), py::arg("jacobian"), py::arg("period") = 0.0)
      .def(
          "set_thresholds",
          [](MovingContact& moving, const Features& variance, double limit, const Joints& steady,
             double steady_limit, double lag) {
            moving.use({variance, limit, steady, steady_limit, lag});
          },
          py::arg("variance"), py::arg("limit"), py::arg("steady"), py::arg("steady_limit"),
          py::arg("lag"))
      .def_property_readonly("observer", &MovingContact::observer,
                             py::return_value_policy::reference_internal)
      .def_property_readonly("load", &MovingContact::load)
      .def_property_readonly("residual",
                             [](const MovingContact& moving) { return moving.residual(); })
      .def_property_readonly("change", [](const MovingContact& moving) { return moving.change(); })
      .def(
          "set_payload",
          [](MovingContact& moving, double mass, const Vector3& centre) {
            moving.setPayload(mass, centre);
          },
          py::arg("mass"), py::arg("centre") = Vector3(Vector3::Zero()))
      .def(
          "feed",
          [](MovingContact& moving, double stamp, const Numbers& position, const Numbers& torque,
             std::optional<double> made) {
            moving.feed(stamp, joints(position, "position"), joints(torque, "torque"), made);
          },
          py::arg("stamp"), py::arg("position"), py::arg("torque"), py::arg("made") = py::none())
      .def("evidence", &MovingContact::evidence)
      .def("steady", &MovingContact::steady)
      .def("still", &MovingContact::still)
      .def("slow", &MovingContact::slow)
      .def("offset", &MovingContact::offset)
      .def("offset_of_motion", &MovingContact::offsetOfMotion)
      .def("before_motion", &MovingContact::beforeMotion)
      .def("weight", &MovingContact::weight, py::arg("residual"), py::arg("position"))
      .def(
          "weight_since",
          [](const MovingContact& moving, const Joints& before) {
            if (!moving.residual())
              throw std::invalid_argument("weight_since: the last sample gave no residual");
            return moving.weight(moving.residual()->torque - before, moving.residual()->position);
          },
          py::arg("before"))
      .def("weight_before_motion", &MovingContact::weightBeforeMotion)
      .def("force_since", &MovingContact::forceSince, py::arg("before"));
}

void bindDetector(py::module_& module) {
  py::class_<RestTorque>(module, "RestTorque")
      .def(py::init<>())
      .def("move", &RestTorque::move, py::arg("gap"), py::arg("velocity"))
      .def("stand", &RestTorque::stand)
      .def("learn", &RestTorque::learn, py::arg("torque"), py::arg("gap"))
      .def_property_readonly("travels", &RestTorque::travels)
      .def_property_readonly("before_motion",
                             [](const RestTorque& rest) { return rest.beforeMotion(); });
  py::class_<ContactDetector>(module, "ContactDetector")
      .def(py::init([](const py::object& settings, const py::object& jacobian) {
             return std::make_unique<ContactDetector>(settingsOf(settings), jacobianOf(jacobian));
           }),
           py::arg("settings"), py::arg("jacobian"))
      .def(
          "arm",
          [](ContactDetector& detector, const std::string& mode, double now, double timeout,
             double k, const std::vector<int>& joints, double mass, double load_share,
             bool carries) {
            detector.arm({mode, now, timeout, k, joints, mass, load_share, carries});
          },
          py::arg("mode"), py::arg("now"), py::arg("timeout"), py::arg("k") = 0.0,
          py::arg("joints") = std::vector<int>(), py::arg("mass") = 0.0,
          py::arg("load_share") = 0.0, py::arg("carries") = false)
      .def(
          "tune",
          [](ContactDetector& detector, const py::object& settings) {
            detector.tune(settingsOf(settings));
          },
          py::arg("settings"))
      .def("disarm", &ContactDetector::disarm)
      .def("learn", &ContactDetector::learn)
      .def("state", &ContactDetector::state)
      .def("still", &ContactDetector::still)
      .def("sigma", &ContactDetector::sigma)
      .def_property_readonly("mode", &ContactDetector::mode)
      .def_property_readonly("margin", &ContactDetector::margin)
      .def_property_readonly("k", &ContactDetector::k)
      .def_property_readonly("watched", &ContactDetector::watched)
      .def_property_readonly("rest_samples", &ContactDetector::restSamples)
      .def("take_largest", &ContactDetector::takeLargest)
      .def(
          "feed",
          [](ContactDetector& detector, double stamp, const Numbers& torque,
             const Numbers& position, const Numbers& velocity) -> std::optional<ContactEvent> {
            const auto tau = sevenOf(torque), q = sevenOf(position), dq = sevenOf(velocity);
            if (!tau || !q || !dq) return std::nullopt;
            return detector.feed(stamp, *tau, *q, *dq);
          },
          py::arg("stamp"), py::arg("torque"), py::arg("position"), py::arg("velocity"));
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "Contact detection in the torques of the arm, without ROS.";
  // The chain and the dynamics of the arm are classes of this module.
  py::module_::import("coglab_controllers");
  bindEvidence(module);
  bindObserver(module);
  bindThresholds(module);
  bindMovingContact(module);
  bindDetector(module);
}
