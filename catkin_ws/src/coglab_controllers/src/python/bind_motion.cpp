#include "bindings.hpp"
#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/ptp/ptp_trajectory.hpp"

namespace coglab_controllers::python {
namespace {

double requireRate(double rate) {
  if (!(rate >= 0.0 && rate <= 1.0))
    throw std::invalid_argument("rate: expected 0 to 1, got " + std::to_string(rate));
  return rate;
}

Pose toPose(const Vector3& position, const QuaternionArray& orientation, const char* name) {
  return {requireFinite(position, name), toQuaternion(orientation, name)};
}

DmpPlan toPlan(const Primitive& primitive, double ratio, bool orientation_control) {
  requireRatio(ratio);
  return {Dmp(primitive), ratio, orientation_control};
}

void bindCartesianMotion(py::module_& module) {
  py::class_<CartesianReference>(module, "CartesianReference",
                                 "Reference of a motion for the inverse kinematics.")
      .def(py::init([](const Vector3& position, const QuaternionArray& orientation,
                       const Vector3& velocity, const Vector3& angular_velocity,
                       bool orientation_control) {
             return CartesianReference{
                 toPose(position, orientation, "pose"), requireFinite(velocity, "velocity"),
                 requireFinite(angular_velocity, "angular_velocity"), orientation_control};
           }),
           py::arg("position"), py::arg("orientation"),
           py::arg("velocity") = Vector3(Vector3::Zero()),
           py::arg("angular_velocity") = Vector3(Vector3::Zero()),
           py::arg("orientation_control") = true)
      .def_property_readonly("position",
                             [](const CartesianReference& r) { return r.pose.position; })
      .def_property_readonly(
          "orientation", [](const CartesianReference& r) { return toArray(r.pose.orientation); })
      .def_readonly("velocity", &CartesianReference::velocity)
      .def_readonly("angular_velocity", &CartesianReference::angular_velocity)
      .def_readonly("orientation_control", &CartesianReference::orientation_control);

  const QuaternionArray none(0.0, 0.0, 0.0, 1.0);
  py::class_<CartesianMotion>(module, "CartesianMotion",
                              "Goal filter, DMP, orientation curve and end of motion.")
      .def(py::init([](double goal_time_constant) {
             GoalFilterParameters parameters;
             parameters.time_constant = goal_time_constant;
             return CartesianMotion(parameters);
           }),
           py::arg("goal_time_constant") = GoalFilterParameters().time_constant)
      .def(
          "start",
          [](CartesianMotion& motion, const Primitive& primitive, const Vector3& position,
             const QuaternionArray& orientation, const Vector3& goal, const QuaternionArray& target,
             const Vector3& velocity, const Vector3& angular_velocity, double ratio,
             bool orientation_control) {
            motion.start(toPlan(primitive, ratio, orientation_control),
                         toPose(position, orientation, "pose"), requireFinite(velocity, "velocity"),
                         requireFinite(angular_velocity, "angular_velocity"),
                         toPose(goal, target, "goal"));
          },
          py::arg("primitive"), py::arg("position"), py::arg("orientation"), py::arg("goal"),
          py::arg("target"), py::arg("velocity") = Vector3(Vector3::Zero()),
          py::arg("angular_velocity") = Vector3(Vector3::Zero()), py::arg("ratio") = 1.0,
          py::arg("orientation_control") = true)
      .def(
          "switch_to",
          [](CartesianMotion& motion, const Primitive& primitive, const Vector3& goal,
             const QuaternionArray& target, double ratio, bool orientation_control) {
            motion.switchTo(toPlan(primitive, ratio, orientation_control),
                            toPose(goal, target, "goal"));
          },
          py::arg("primitive"), py::arg("goal"), py::arg("target"), py::arg("ratio") = 1.0,
          py::arg("orientation_control") = true)
      .def(
          "step",
          [](CartesianMotion& motion, double dt, const Vector3& goal, const QuaternionArray& target,
             double rate) {
            return motion.step(requireStep(dt), toPose(goal, target, "goal"), requireRate(rate));
          },
          py::arg("dt"), py::arg("goal"), py::arg("target") = none, py::arg("rate") = 1.0)
      .def("stop", &CartesianMotion::stop)
      .def_property_readonly("phase",
                             [](const CartesianMotion& motion) {
                               switch (motion.phase()) {
                                 case CartesianMotion::Phase::Running:
                                   return "running";
                                 case CartesianMotion::Phase::Ended:
                                   return "ended";
                                 default:
                                   return "idle";
                               }
                             })
      .def_property_readonly("event",
                             [](const CartesianMotion& motion) {
                               switch (motion.event()) {
                                 case CartesianMotion::Event::Ended:
                                   return "ended";
                                 case CartesianMotion::Event::FollowsAgain:
                                   return "follows_again";
                                 default:
                                   return "";
                               }
                             })
      .def_property_readonly("position",
                             [](const CartesianMotion& m) { return m.dmp().state().position; })
      .def_property_readonly("velocity",
                             [](const CartesianMotion& m) { return m.dmp().state().velocity; })
      .def_property_readonly("acceleration",
                             [](const CartesianMotion& m) { return m.dmp().state().acceleration; })
      .def_property_readonly("goal", [](const CartesianMotion& m) { return m.goal(); })
      .def_property_readonly("remaining_distance", &CartesianMotion::remainingDistance)
      .def_property_readonly("remaining_time", &CartesianMotion::remainingTime);
}

void bindGoals(py::module_& module) {
  py::class_<GoalFilter>(module, "GoalFilter",
                         "Third-order tracker of a goal with ramp compensation.")
      .def(py::init([](double time_constant, double max_innovation) {
             GoalFilterParameters parameters;
             parameters.time_constant = time_constant;
             parameters.max_innovation = max_innovation;
             return GoalFilter(parameters);
           }),
           py::arg("time_constant") = GoalFilterParameters().time_constant,
           py::arg("max_innovation") = GoalFilterParameters().max_innovation)
      .def(
          "reset",
          [](GoalFilter& f, const Vector3& goal) {
            f.begin({requireFinite(goal, "goal"), Quaternion::Identity()});
          },
          py::arg("goal"))
      .def(
          "update",
          [](GoalFilter& f, double dt, const Vector3& goal) {
            const Pose seen{requireFinite(goal, "goal"), Quaternion::Identity()};
            f.measureNoise(requireStep(dt), seen);
            f.update(dt, seen);
            return py::make_tuple(f.position(), f.velocity());
          },
          py::arg("dt"), py::arg("goal"), "Returns g (m) and g' (m/s).")
      .def_property_readonly("position", &GoalFilter::position)
      .def_property_readonly("velocity", &GoalFilter::velocity);

  py::class_<GoalLimits>(
      module, "GoalLimits",
      "Bounds of a moving goal: the motion ends if it leaves its region, retreats or falls.")
      .def(py::init([](const Vector3& region_low, const Vector3& region_high, double retreat,
                       double drop, const Vector3& hand, const Vector3& goal) {
             const GoalBounds bounds{region_low, region_high, retreat, drop};
             if (*bounds.wrong() != 0) throw std::invalid_argument(bounds.wrong());
             GoalObservation first;
             first.position = requireFinite(goal, "goal");
             GoalLimits limits;
             limits.begin(first, requireFinite(hand, "hand"), bounds);
             return limits;
           }),
           py::arg("region_low"), py::arg("region_high"), py::arg("retreat"), py::arg("drop"),
           py::arg("hand"), py::arg("goal"))
      .def(
          "update",
          [](GoalLimits& limits, double dt, const Vector3& goal) {
            const Reason reason = limits.checkBounds(requireStep(dt), requireFinite(goal, "goal"));
            return py::make_tuple(static_cast<int>(reason.number()), reason.str());
          },
          py::arg("dt"), py::arg("goal"),
          "Returns (ReasonCode, sentence); (0, '') while the motion may continue.");
}

void bindOrientationCurve(py::module_& module) {
  py::class_<OrientationCurve>(module, "OrientationCurve",
                               "Quaternion Bezier curve between two orientations.")
      .def(py::init([](const QuaternionArray& start, const QuaternionArray& target, double duration,
                       const Vector3& angular_velocity) {
             if (!(duration > 0.0))
               throw std::invalid_argument("duration: expected a positive number of seconds");
             OrientationCurve curve;
             curve.start(toQuaternion(start), requireFinite(angular_velocity, "angular_velocity"),
                         toQuaternion(target), duration);
             return curve;
           }),
           py::arg("start"), py::arg("target"), py::arg("duration") = 1.0,
           py::arg("angular_velocity") = Vector3(Vector3::Zero()))
      .def(
          "set_target",
          [](OrientationCurve& c, const QuaternionArray& target) {
            c.setTarget(toQuaternion(target));
          },
          py::arg("target"))
      .def(
          "at", [](const OrientationCurve& c, double progress) { return toArray(c.at(progress)); },
          py::arg("progress"));
}

void bindPtp(py::module_& module) {
  py::class_<PtpTrajectory>(module, "PtpTrajectory",
                            "Synchronised, acceleration-limited motion to rest at a target.")
      .def(py::init<const JointVector&, const JointVector&, const JointVector&, const JointVector&,
                    const JointVector&, int>(),
           py::arg("position"), py::arg("velocity"), py::arg("target"), py::arg("max_velocity"),
           py::arg("max_acceleration"), py::arg("joints") = kMaxJoints)
      .def_property_readonly("duration", &PtpTrajectory::duration)
      .def_property_readonly("target", &PtpTrajectory::target)
      .def(
          "at",
          [](const PtpTrajectory& trajectory, double t) {
            PtpPoint point;
            trajectory.at(t, point);
            return py::make_tuple(point.position, point.velocity, point.acceleration);
          },
          py::arg("t"),
          "Position, velocity and acceleration, each (7,), t seconds after the start.");
}

}  // namespace

void bindMotion(py::module_& module) {
  bindCartesianMotion(module);
  bindGoals(module);
  bindOrientationCurve(module);
  bindPtp(module);
}

}  // namespace coglab_controllers::python
