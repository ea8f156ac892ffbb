#include "bindings.hpp"
#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/limits/phase_governor.hpp"
#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_controllers::python {
namespace {

using coglab_rt::Interpolator;
using coglab_rt::JointLimits;

void bindTable(py::module_& module) {
  py::class_<JointLimits>(module, "JointLimits",
                          "The robot's table of joint limits; vectors (7,) in wire order.")
      .def(py::init<>())
      .def_readwrite("lower_position", &JointLimits::lower_position)
      .def_readwrite("upper_position", &JointLimits::upper_position)
      .def_readwrite("velocity", &JointLimits::velocity)
      .def_readwrite("acceleration", &JointLimits::acceleration)
      .def_readwrite("jerk", &JointLimits::jerk)
      .def_readwrite("torque", &JointLimits::torque);
  module.def("load_joint_limits", &coglab_rt::loadJointLimits, py::arg("path"),
             py::arg("profile") = "default", py::arg("own_path") = "",
             "Reads lwr_description/config/joint_limits.yaml.");

  py::class_<Interpolator>(module, "Interpolator",
                           "Jerk-limited interpolator from target velocities to positions.")
      .def(py::init<const JointLimits&>(), py::arg("limits"))
      .def(
          "reset",
          [](Interpolator& i, const JointVector& q) { i.reset(requireFinite(q, "position")); },
          py::arg("position"))
      .def(
          "step",
          [](Interpolator& i, const JointVector& velocity, double dt) {
            i.step(requireFinite(velocity, "velocity"), requireStep(dt));
            return i.position();
          },
          py::arg("velocity"), py::arg("dt"), "Returns the commanded position (7,) in rad.")
      .def_property_readonly("position",
                             [](const Interpolator& i) { return JointVector(i.position()); })
      .def_property_readonly("velocity",
                             [](const Interpolator& i) { return JointVector(i.velocity()); })
      .def_property_readonly("acceleration",
                             [](const Interpolator& i) { return JointVector(i.acceleration()); });
}

void bindWorkspace(py::module_& module) {
  const WorkspaceParameters standard;
  py::class_<WorkspaceParameters>(module, "WorkspaceParameters",
                                  "Box, sphere around the base, stretch of the arm.")
      .def(py::init([](const Vector3& box_min, const Vector3& box_max, const Vector3& base_centre,
                       double base_radius, double max_stretch) {
             return WorkspaceParameters{box_min, box_max, base_centre, base_radius, max_stretch};
           }),
           py::arg("box_min") = standard.box_min, py::arg("box_max") = standard.box_max,
           py::arg("base_centre") = standard.base_centre,
           py::arg("base_radius") = standard.base_radius,
           py::arg("max_stretch") = standard.max_stretch)
      .def_readwrite("box_min", &WorkspaceParameters::box_min)
      .def_readwrite("box_max", &WorkspaceParameters::box_max)
      .def_readwrite("base_centre", &WorkspaceParameters::base_centre)
      .def_readwrite("base_radius", &WorkspaceParameters::base_radius)
      .def_readwrite("max_stretch", &WorkspaceParameters::max_stretch);

  py::class_<Workspace>(module, "Workspace", "Allowed positions of the hand.")
      .def(py::init<const WorkspaceParameters&>(), py::arg("parameters") = standard)
      .def("contains", &Workspace::contains, py::arg("point"))
      .def(
          "violated",
          [](const Workspace& w, const Vector3& point) { return describe(w.violated(point)); },
          py::arg("point"))
      .def("project", &Workspace::project, py::arg("point"), "The nearest allowed point.");
}

void bindGuard(py::module_& module) {
  const GuardParameters standard;
  py::class_<GuardResult>(module, "GuardResult", "One cycle of the guard.")
      .def_readonly("velocity", &GuardResult::velocity)
      .def_readonly("scale", &GuardResult::scale)
      .def_readonly("joint", &GuardResult::joint)
      .def_property_readonly("reason", [](const GuardResult& r) { return describe(r.reason); })
      .def_property_readonly("border", [](const GuardResult& r) { return describe(r.border); });

  py::class_<Guard>(module, "Guard",
                    "Scales joint velocities to satisfy all limits; their direction is kept.")
      .def(py::init([](const Chain& chain, const JointLimits& limits,
                       const WorkspaceParameters& workspace, double hand_speed, double elbow_speed,
                       double position_margin, double reaction_time) {
             GuardParameters p;
             p.lower_position = limits.lower_position;
             p.upper_position = limits.upper_position;
             p.velocity = limits.velocity;
             p.acceleration = limits.acceleration;
             p.jerk = limits.jerk;
             p.workspace = workspace;
             p.hand_speed = hand_speed;
             p.elbow_speed = elbow_speed;
             p.position_margin = position_margin;
             p.reaction_time = reaction_time;
             return Guard(p, chain);
           }),
           py::arg("chain"), py::arg("limits"), py::arg("workspace") = WorkspaceParameters(),
           py::arg("hand_speed") = standard.hand_speed,
           py::arg("elbow_speed") = standard.elbow_speed,
           py::arg("position_margin") = standard.position_margin,
           py::arg("reaction_time") = standard.reaction_time)
      .def(
          "limit",
          [](const Guard& guard, const Chain& chain, const JointVector& q,
             const JointVector& velocity) {
            GuardResult result;
            guard.limit(chain.evaluate(q), q, velocity, result);
            return result;
          },
          py::arg("chain"), py::arg("q"), py::arg("velocity"))
      .def("speed_to_stop", &Guard::speedToStop, py::arg("joint"), py::arg("room"));

  py::class_<PhaseGovernor>(module, "PhaseGovernor",
                            "Slows the clock of a motion so that the reference waits for the arm.")
      .def(py::init<double, double>(), py::arg("rise") = 2.0, py::arg("fall") = 10.0)
      .def("update", &PhaseGovernor::update, py::arg("dt"), py::arg("speed_scale"),
           py::arg("limit_scale"))
      .def("reset", &PhaseGovernor::reset, py::arg("rate") = 1.0)
      .def_property_readonly("rate", &PhaseGovernor::rate);
}

}  // namespace

void bindLimits(py::module_& module) {
  bindTable(module);
  bindWorkspace(module);
  bindGuard(module);
}

}  // namespace coglab_controllers::python
