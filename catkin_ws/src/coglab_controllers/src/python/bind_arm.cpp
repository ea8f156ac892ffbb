#include "bindings.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/kinematics/dynamics.hpp"

namespace coglab_controllers::python {
namespace {

void bindChain(py::module_& module) {
  py::class_<Chain>(module, "Chain", "Kinematic chain of 6 or 7 revolute joints from a URDF.")
      .def(py::init<const std::string&, const std::string&, const std::string&>(), py::arg("urdf"),
           py::arg("base_link") = "lwr_base_link", py::arg("tip_link") = "ih2_palm")
      .def_property_readonly("joints", &Chain::joints)
      .def_property_readonly("joint_names", &Chain::jointNames)
      .def_property_readonly("reach", &Chain::reach)
      .def(
          "fk",
          [](const Chain& chain, const JointVector& q) {
            const ChainState state = chain.evaluate(requireFinite(q, "q"));
            return py::make_tuple(state.tool.position, toArray(state.tool.orientation));
          },
          py::arg("q"), "Position (3,) in m and orientation (4,) x y z w of the tip.")
      .def(
          "jacobian",
          [](const Chain& chain, const JointVector& q) {
            return chain.evaluate(requireFinite(q, "q")).jacobian;
          },
          py::arg("q"),
          "Jacobian (6, 7) of the tip, translation above rotation, in the base frame.")
      .def(
          "joint_origins",
          [](const Chain& chain, const JointVector& q) -> Eigen::Matrix<double, kMaxJoints, 3> {
            return chain.evaluate(requireFinite(q, "q")).origins.transpose();
          },
          py::arg("q"), "A point on each joint's axis, (7, 3) in m.");
}

void bindDynamics(py::module_& module) {
  py::class_<ArmDynamics>(module, "ArmDynamics", "Rigid-body terms of the arm, by KDL.")
      .def(py::init<const std::string&, const std::string&, const std::string&>(), py::arg("urdf"),
           py::arg("base_link") = "lwr_base_link", py::arg("tip_link") = "ih2_palm")
      .def("set_payload", &ArmDynamics::setPayload, py::arg("mass"),
           py::arg("centre") = Vector3(Vector3::Zero()))
      .def(
          "evaluate",
          [](ArmDynamics& dynamics, const JointVector& q, const JointVector& velocity) {
            return dynamics.evaluate(requireFinite(q, "q"), requireFinite(velocity, "velocity"));
          },
          py::arg("q"), py::arg("velocity"));
  py::class_<DynamicTerms>(module, "DynamicTerms", "Terms at one posture and velocity.")
      .def_readonly("mass", &DynamicTerms::mass)
      .def_readonly("momentum", &DynamicTerms::momentum)
      .def_readonly("coriolis", &DynamicTerms::coriolis)
      .def_readonly("transposed", &DynamicTerms::transposed)
      .def_readonly("gravity", &DynamicTerms::gravity);
}

void bindIk(py::module_& module) {
  py::class_<IkResult>(module, "IkResult", "One cycle of the inverse kinematics.")
      .def_readonly("velocity", &IkResult::velocity)
      .def_readonly("position_velocity", &IkResult::position_velocity)
      .def_readonly("rotation_velocity", &IkResult::rotation_velocity)
      .def_readonly("position_error", &IkResult::position_error)
      .def_readonly("rotation_error", &IkResult::rotation_error)
      .def_readonly("smallest_singular_value_position", &IkResult::smallest_singular_value_position)
      .def_readonly("smallest_singular_value_rotation", &IkResult::smallest_singular_value_rotation)
      .def_readonly("second_task_scale", &IkResult::second_task_scale)
      .def_readonly("scale", &IkResult::scale)
      .def_readonly("rotation_rejected", &IkResult::rotation_rejected);

  py::class_<PostureTask>(module, "PostureTask",
                          "Second task that moves the joints towards a posture.")
      .def(py::init<const JointVector&, double>(), py::arg("posture"), py::arg("gain") = 1.0);

  const IkParameters standard;
  py::class_<TwoTaskIk>(module, "TwoTaskIk",
                        "Inverse kinematics with two priorities, eq. (6)-(12).")
      .def(py::init([](double pos_clik_gain, double rot_clik_gain, double singularity_threshold,
                       double stretch_threshold, bool rotation_first_scaling,
                       const JointVector& velocity_limit, const JointVector& acceleration_limit,
                       const JointVector& jerk_limit, double correction_speed) {
             IkParameters parameters;
             parameters.pos_clik_gain = pos_clik_gain;
             parameters.rot_clik_gain = rot_clik_gain;
             parameters.singularity_threshold = singularity_threshold;
             parameters.stretch_threshold = stretch_threshold;
             parameters.rotation_first_scaling = rotation_first_scaling;
             parameters.velocity_limit = velocity_limit;
             parameters.acceleration_limit = acceleration_limit;
             parameters.jerk_limit = jerk_limit;
             parameters.correction_speed = correction_speed;
             return TwoTaskIk(parameters);
           }),
           py::arg("pos_clik_gain") = standard.pos_clik_gain,
           py::arg("rot_clik_gain") = standard.rot_clik_gain,
           py::arg("singularity_threshold") = standard.singularity_threshold,
           py::arg("stretch_threshold") = standard.stretch_threshold,
           py::arg("rotation_first_scaling") = standard.rotation_first_scaling,
           py::arg("velocity_limit") = standard.velocity_limit,
           py::arg("acceleration_limit") = standard.acceleration_limit,
           py::arg("jerk_limit") = standard.jerk_limit,
           py::arg("correction_speed") = standard.correction_speed,
           "Limits of acceleration (7,) and jerk (7,) bound the speed that corrects an error, so "
           "that "
           "each joint can brake in time. correction_speed (m/s) bounds the correction of "
           "position errors.")
      .def(
          "solve",
          [](const TwoTaskIk& ik, const Chain& chain, const JointVector& q,
             const CartesianReference& reference, const PostureTask* task,
             const JointVector& velocity, double dt) {
            ChainState state;
            chain.evaluate(requireFinite(q, "q"), requireFinite(velocity, "velocity"),
                           requireStep(dt), state);
            IkResult result;
            if (task != nullptr) {
              ik.solve(state, q, reference, *task, result);
            } else {
              ik.solve(state, q, reference, result);
            }
            return result;
          },
          py::arg("chain"), py::arg("q"), py::arg("reference"), py::arg("task") = nullptr,
          py::arg("velocity") = JointVector(JointVector::Zero()), py::arg("dt") = 0.0,
          "Joint velocities for a reference; `task` replaces the orientation as second task.");
}

}  // namespace

void bindArm(py::module_& module) {
  bindChain(module);
  bindDynamics(module);
  bindIk(module);
  module.def(
      "exp_rotation", [](const Vector3& r) { return toArray(expRotation(r)); },
      py::arg("rotation_vector"), "Quaternion (4,) of a rotation vector (3,) in rad.");
  module.def(
      "rotation_between",
      [](const QuaternionArray& from, const QuaternionArray& to) {
        return rotationBetween(toQuaternion(from), toQuaternion(to));
      },
      py::arg("start"), py::arg("target"),
      "Rotation vector (3,) in rad, base frame, from start to target.");
}

}  // namespace coglab_controllers::python
