#include "bindings.hpp"
#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/dmp/learning.hpp"
#include "coglab_controllers/dmp/library.hpp"

namespace coglab_controllers::python {
namespace {

// One row per time, as usual in numpy.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Trajectory toTrajectory(const Eigen::VectorXd& times, const Points& positions) {
  return {std::vector<double>(times.data(), times.data() + times.size()), positions.transpose()};
}

GoalWeight toGoalWeight(const std::string& kind, double centre, double steepness) {
  if (kind != "linear" && kind != "sigmoid") {
    throw std::invalid_argument("kind: expected 'linear' or 'sigmoid', got '" + kind + "'");
  }
  return {kind == "linear" ? GoalWeight::Kind::Linear : GoalWeight::Kind::Sigmoid, centre,
          steepness};
}

void bindPrimitive(py::module_& module) {
  py::class_<GoalWeight>(module, "GoalWeight",
                         "Weight w(s) of eq. (1): 0 at the start of a motion, 1 at its end.")
      .def(py::init(&toGoalWeight), py::arg("kind") = "linear", py::arg("centre") = 0.5,
           py::arg("steepness") = 10.0)
      .def_property_readonly("kind",
                             [](const GoalWeight& w) {
                               return w.kind == GoalWeight::Kind::Linear ? "linear" : "sigmoid";
                             })
      .def_readonly("centre", &GoalWeight::centre)
      .def_readonly("steepness", &GoalWeight::steepness)
      .def("__call__", &GoalWeight::operator(), py::arg("s"), "w(s) at phase s.");

  py::class_<Primitive>(module, "Primitive",
                        "A learnt motion primitive: all parameters of eq. (1)-(5).")
      .def(py::init<>())
      .def_readwrite("id", &Primitive::id)
      .def_readwrite("description", &Primitive::description)
      .def_readwrite("duration", &Primitive::duration, "s, of the demonstration")
      .def_readwrite("alpha", &Primitive::alpha, "rate of the phase, eq. (3)")
      .def_readwrite("stiffness", &Primitive::stiffness, "K of eq. (1)")
      .def_readwrite("damping", &Primitive::damping, "D of eq. (1)")
      .def_readwrite("goal_weight", &Primitive::goal_weight)
      .def_property(
          "mapping", [](const Primitive& p) { return describe(p.mapping); },
          [](Primitive& p, const std::string& mapping) { p.mapping = toShapeMapping(mapping); })
      .def_readwrite("start", &Primitive::start, "m, (3,)")
      .def_readwrite("goal", &Primitive::goal, "m, (3,)")
      .def_readwrite("start_velocity", &Primitive::start_velocity, "m/s, (3,)")
      .def_readwrite("centres", &Primitive::centres, "c_i, (N,)")
      .def_readwrite("widths", &Primitive::widths, "h_i, (N,)")
      .def_property(
          "weights", [](const Primitive& p) -> Points { return p.weights.transpose(); },
          [](Primitive& p, const Points& weights) { p.weights = weights.transpose(); },
          "w_i, m, (N, 3)")
      .def(
          "validate", [](const Primitive& p) { validate(p); },
          "Raises ValueError with the name of the invalid field.")
      .def(
          "moving_point", [](const Primitive& p, double s) { return Dmp(p).movingPoint(s); },
          py::arg("s"), "phi(s) of eq. (5), m, (3,)");
}

void bindLibrary(py::module_& module) {
  py::register_exception<LibraryError>(module, "LibraryError", PyExc_ValueError);
  py::class_<Library>(module, "Library", "Primitives by id, read from and written to XML.")
      .def(py::init<>())
      .def("load", &Library::load, py::arg("path"),
           "Adds all primitives of a file, or none; returns their number.")
      .def("parse", &Library::parse, py::arg("text"), py::arg("name") = "text",
           "The same from text.")
      .def("save", &Library::save, py::arg("path"), "Writes all primitives.")
      .def("format", &Library::format, "The text that save() writes.")
      .def("add", &Library::add, py::arg("primitive"))
      .def("__getitem__",
           [](const Library& library, const std::string& id) {
             if (library.find(id) == nullptr) {
               try {
                 library.at(id);
               } catch (const std::invalid_argument& error) {
                 throw py::key_error(error.what());
               }
             }
             return *library.find(id);
           })
      .def("__contains__", [](const Library& library,
                              const std::string& id) { return library.find(id) != nullptr; })
      .def("__len__", [](const Library& library) { return library.primitives().size(); })
      .def("ids", [](const Library& library) {
        std::vector<std::string> ids;
        for (const auto& [id, primitive] : library.primitives()) ids.push_back(id);
        return ids;
      });
}

void bindStepping(py::module_& module) {
  py::class_<Dmp>(module, "Dmp", "A running primitive: three axes on one phase.")
      .def(py::init([](const Primitive& primitive, const Vector3& position, const Vector3& goal,
                       const Vector3& velocity, double ratio) {
             requireRatio(ratio);
             Dmp dmp(primitive);
             dmp.start(requireFinite(position, "position"), requireFinite(velocity, "velocity"),
                       requireFinite(goal, "goal"), ratio);
             return dmp;
           }),
           py::arg("primitive"), py::arg("position"), py::arg("goal"),
           py::arg("velocity") = Vector3(Vector3::Zero()), py::arg("ratio") = 1.0)
      .def(
          "switch_to",
          [](Dmp& dmp, const Primitive& primitive, const Vector3& goal, double ratio) {
            requireRatio(ratio);
            dmp.switchTo(Dmp(primitive), requireFinite(goal, "goal"), ratio);
          },
          py::arg("primitive"), py::arg("goal"), py::arg("ratio") = 1.0,
          "Changes the primitive during a motion; phase, position and velocity are kept.")
      .def(
          "set_ratio",
          [](Dmp& dmp, double ratio) {
            requireRatio(ratio);
            dmp.setRatio(ratio);
          },
          py::arg("ratio"))
      .def(
          "step",
          [](Dmp& dmp, double dt, const Vector3& goal, const Vector3& goal_velocity, double rate) {
            if (!(rate >= 0.0 && rate <= 1.0)) throw std::invalid_argument("rate: expected 0 to 1");
            dmp.step(requireStep(dt), requireFinite(goal, "goal"),
                     requireFinite(goal_velocity, "goal_velocity"), rate);
            return dmp.state().position;
          },
          py::arg("dt"), py::arg("goal"), py::arg("goal_velocity") = Vector3(Vector3::Zero()),
          py::arg("rate") = 1.0, "One cycle; returns the position (m, (3,)).")
      .def(
          "roll_out",
          [](Dmp& dmp, const Vector3& goal, double duration, double dt) {
            requireFinite(goal, "goal");
            if (!(dt > 0.0 && duration >= 0.0 && duration / dt < 1e7)) {
              throw std::invalid_argument("expected a positive dt and at most 1e7 steps");
            }
            const auto count = static_cast<Eigen::Index>(std::floor(duration / dt + 1e-9)) + 1;
            Eigen::VectorXd times(count);
            Points positions(count, 3), velocities(count, 3);
            for (Eigen::Index i = 0; i < count; ++i) {
              if (i > 0) dmp.step(dt, goal);
              times[i] = static_cast<double>(i) * dt;
              positions.row(i) = dmp.state().position.transpose();
              velocities.row(i) = dmp.state().velocity.transpose();
            }
            return py::make_tuple(times, positions, velocities);
          },
          py::arg("goal"), py::arg("duration"), py::arg("dt") = 0.005,
          "Steps to a fixed goal; returns times (n,), positions (n, 3) and velocities (n, 3).")
      .def_property_readonly("position", [](const Dmp& dmp) { return dmp.state().position; })
      .def_property_readonly("velocity", [](const Dmp& dmp) { return dmp.state().velocity; })
      .def_property_readonly("acceleration",
                             [](const Dmp& dmp) { return dmp.state().acceleration; })
      .def_property_readonly("phase", [](const Dmp& dmp) { return dmp.state().phase; })
      .def_property_readonly("progress", &Dmp::progress)
      .def_property_readonly("tau", &Dmp::tau)
      .def_property_readonly("remaining_time", &Dmp::remainingTime);
}

}  // namespace

void bindDmp(py::module_& module) {
  module.attr("MAX_BASIS") = kMaxBasis;
  bindPrimitive(module);
  bindLibrary(module);
  bindStepping(module);
  module.def(
      "learn",
      [](const std::string& id,
         const std::vector<std::pair<Eigen::VectorXd, Points>>& demonstrations, int basis_count,
         double alpha, double stiffness, const GoalWeight& goal_weight, const std::string& mapping,
         double regularisation, const std::vector<std::string>& allow) {
        std::vector<Trajectory> trajectories;
        for (const auto& [times, positions] : demonstrations)
          trajectories.push_back(toTrajectory(times, positions));
        return learn(id, trajectories,
                     {basis_count, alpha, stiffness, goal_weight, toShapeMapping(mapping),
                      regularisation, allow});
      },
      py::arg("id"), py::arg("demonstrations"),
      py::arg("basis_count") = LearningOptions().basis_count,
      py::arg("alpha") = LearningOptions().alpha,
      py::arg("stiffness") = LearningOptions().stiffness, py::arg("goal_weight") = GoalWeight(),
      py::arg("mapping") = "none", py::arg("regularisation") = LearningOptions().regularisation,
      py::arg("allow") = std::vector<std::string>(),
      "Learns a primitive from one or several demonstrations, each (times (n,) in s, positions (n, "
      "3) in m).");
  module.def(
      "reproduce",
      [](const Primitive& primitive, const Eigen::VectorXd& times, double dt) -> Points {
        if (!(dt > 1e-6)) throw std::invalid_argument("dt: expected more than 1e-6 s");
        return reproduce(primitive, std::vector<double>(times.data(), times.data() + times.size()),
                         dt)
            .transpose();
      },
      py::arg("primitive"), py::arg("times"), py::arg("dt") = 0.001,
      "Path (n, 3) from the primitive's own start to its own goal at times (n,) in s.");
}

}  // namespace coglab_controllers::python
