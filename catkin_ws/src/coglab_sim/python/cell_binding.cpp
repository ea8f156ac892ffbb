/// Python module coglab_sim._cell: the simulated cell without ROS, one FRI period per call.
#include "py_cell.hpp"

namespace py = pybind11;
using namespace coglab_sim;
using namespace coglab_sim::python;

PYBIND11_MODULE(_cell, m) {
  m.doc() =
      "The simulated cell: robot controller, arm, object and hands behind the FRI wire. SI units, "
      "quaternions x y z w.";

  py::class_<PyCell>(m, "Cell",
                     "One FRI period per step(); the same seed and inputs give the same bytes.")
      .def(py::init<const std::string&, const py::dict&>(), py::arg("urdf"),
           py::arg("parameters") = py::dict(),
           "urdf: path of the robot description; parameters: names and values as in "
           "parameters(), except those of node_only.")
      .def("step", &PyCell::step, py::arg("answer") = py::none(),
           "Takes the 376 bytes that answer the last measurement (None: no answer), advances one "
           "FRI period and returns "
           "the next measurement, 916 bytes, or None if nothing is sent.")
      .def("truth", &PyCell::truth, "True state of the cell; control code must not read it.")
      .def(
          "view", &PyCell::view,
          "The part of truth() that people and trackers can observe: (position and rotation of "
          "the "
          "robot's hand, closure of its fingers, position and rotation of the object, force on the "
          "person's hand, position and rotation of the person's hand).")
      .def("handover", &PyCell::handover,
           "The part of truth() that decides about a handover: (held_by, dropped, touch_force as a "
           "number, N).")
      .def_property_readonly("period", [](const PyCell& c) { return c.cell().period(); })
      .def_property_readonly("time", [](const PyCell& c) { return c.cell().controller().time(); })
      .def_property_readonly("set_point",
                             [](const PyCell& c) { return c.cell().controller().setPoint(); })
      .def_property_readonly("position",
                             [](const PyCell& c) { return Vector7(c.cell().plant().position()); })
      .def_property_readonly("velocity",
                             [](const PyCell& c) { return Vector7(c.cell().plant().velocity()); })
      .def_property_readonly(
          "fastest", [](const PyCell& c) { return c.cell().fastest(); },
          "rad/s, largest speed of each joint in any step of the last period.")
      .def_property_readonly(
          "fri_state",
          [](const PyCell& c) { return static_cast<int>(c.cell().controller().friState()); })
      .def_property_readonly(
          "quality",
          [](const PyCell& c) { return static_cast<int>(c.cell().controller().friQuality()); })
      .def_property_readonly(
          "messages",
          [](const PyCell& c) {
            py::list list;
            for (const auto& message : c.cell().controller().messages()) {
              list.append(py::make_tuple(message.time, message.text));
            }
            return list;
          },
          "The controller's message window: (time, text), newest last.")
      .def_property_readonly(
          "limit_switches", [](const PyCell& c) { return c.cell().controller().limitSwitches(); },
          "Number of set-points in command mode beyond a software limit switch.")
      .def_property_readonly("rejections",
                             [](const PyCell& c) {
                               const auto& r = c.cell().controller().rejections();
                               py::dict d;
                               d["wrong_size"] = r.wrong_size;
                               d["wrong_header"] = r.wrong_header;
                               d["stale"] = r.stale;
                               d["repeated"] = r.repeated;
                               return d;
                             })
      .def(
          "receive",
          [](PyCell& c, const py::bytes& data, double latency) {
            const std::string bytes = data;
            c.cell().receive(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                             latency);
          },
          py::arg("data"), py::arg("latency") = 0.0,
          "Passes one datagram to the controller before the next step().")
      .def(
          "set_human",
          [](PyCell& c, const Vector3d& position, const Eigen::Vector4d& rotation,
             const Vector3d& velocity, const Vector3d& spin, double grip, double grip_force) {
            c.cell().setHuman({makePose(position, rotation), {velocity, spin}, grip, grip_force});
          },
          py::arg("position"), py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1),
          py::arg("velocity") = Vector3d(Vector3d::Zero()),
          py::arg("spin") = Vector3d(Vector3d::Zero()), py::arg("grip") = 0.0,
          py::arg("grip_force") = 20.0, "The person's hand in the world; grip 0..1, force N.")
      .def(
          "set_motors",
          [](PyCell& c, const std::array<double, 5>& speed, const std::array<double, 5>& target,
             const std::array<double, 5>& current) {
            MotorCommands commands;
            for (std::size_t i = 0; i < commands.size(); ++i)
              commands[i] = {speed[i], target[i], current[i]};
            c.cell().setMotors(commands);
          },
          py::arg("speed"), py::arg("target"), py::arg("current"),
          "Commands of the five motors of the hand: shares of the full speed and of the stroke (0 "
          "open), counts of current at which they stop.")
      .def(
          "motors", [](const PyCell& c) { return motorList(c.cell().plant()); },
          "Of each motor: position (share of the stroke), current (counts), effort (counts that "
          "the tension stands for), tension (N), moving, locked.")
      .def(
          "motor_states", [](const PyCell& c) { return motorTuples(c.cell().plant()); },
          "The same as tuples (position, current, effort, moving, locked), which are faster.")
      .def_property_readonly(
          "touch_total",
          [](const PyCell& c) {
            Vector3d total = Vector3d::Zero();
            for (const Vector3d& force : c.cell().touch().phalanges) total += force;
            return Vector3d(total + c.cell().touch().palm);
          },
          "N (3,), sum of the forces of touch().")
      .def(
          "palm_sensors",
          [](const PyCell& c) {
            const PalmReading& palm = c.cell().palmSensors();
            py::dict result;
            result["orientation"] = Eigen::Vector4d(palm.orientation.coeffs());
            result["angular_velocity"] = palm.angular_velocity;
            result["linear_acceleration"] = palm.linear_acceleration;
            result["force"] = palm.force;
            result["torque"] = palm.torque;
            return result;
          },
          "IMU and wrench sensor in the palm, axes of ih2_palm: orientation in the world (x y z "
          "w), "
          "angular_velocity rad/s, linear_acceleration m/s^2 (with gravity: +9.81 upward at rest), "
          "force N and torque Nm of object, person and push on the hand. With noise and bias.")
      .def(
          "touch", [](const PyCell& c) { return touchDict(c.cell().plant(), c.cell().touch()); },
          "Forces on phalanges and palm, N, axes of ih2_palm.")
      .def(
          "set_push",
          [](PyCell& c, const Vector3d& force, const Vector3d& torque) {
            c.cell().setPush({force, torque});
          },
          py::arg("force"), py::arg("torque") = Vector3d(Vector3d::Zero()),
          "Wrench on the palm, world axes, N and Nm.")
      .def(
          "place",
          [](PyCell& c, const std::string& where, const Vector3d& position,
             const Eigen::Vector4d& rotation) {
            c.cell().place(placeOf(where), makePose(position, rotation));
          },
          py::arg("where"), py::arg("position") = Vector3d(Vector3d::Zero()),
          py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1),
          "human_hand, robot_hand or world; pose in that frame.")
      .def(
          "block", [](PyCell& c, bool on) { c.cell().setBlock(on); },
          "Blocks the arm at its position, or releases it.")
      .def(
          "set_loss",
          [](PyCell& c, double to_pc, double from_pc) { c.cell().setLoss(to_pc, from_pc); },
          py::arg("to_pc"), py::arg("from_pc"))
      .def(
          "lose_next", [](PyCell& c, int packets) { c.cell().loseNext(packets); },
          "Loses the next packets in both directions.")
      .def("enabling_switch",
           [](PyCell& c, bool pressed) { c.cell().controller().setEnablingSwitch(pressed); })
      .def(
          "drive_error",
          [](PyCell& c, int joint, bool on) { c.cell().controller().setDriveError(joint, on); },
          py::arg("joint"), py::arg("on") = true)
      .def(
          "silence", [](PyCell& c, double duration) { c.cell().controller().setSilent(duration); },
          "The controller sends nothing for this time, s.")
      .def("leave_command_mode",
           [](PyCell& c, const std::string& why) { c.cell().controller().leaveCommandMode(why); })
      .def(
          "restart_program",
          [](PyCell& c, double period, double pause) {
            c.cell().controller().restartProgram(period, pause);
          },
          py::arg("period"), py::arg("pause") = 0.5,
          "The operator restarts the KRL program with another FRI period, s.")
      .def("acknowledge", [](PyCell& c) { c.cell().controller().acknowledge(); });

  definePlant(m);

  m.def(
      "parameters",
      [] {
        const CellConfig defaults;
        py::list rows;
        for (const auto& parameter : cellParameters()) {
          py::dict row;
          row["name"] = parameter.name;
          row["default"] = parameter.get(defaults);
          row["low"] = parameter.low;
          row["high"] = parameter.high;
          row["unit"] = parameter.unit;
          row["source"] = parameter.source;
          row["text"] = parameter.text;
          row["node_only"] = parameter.node_only;
          rows.append(row);
        }
        return rows;
      },
      "Every parameter of the cell: name, default, low and high end of the range of numbers "
      "(equal: "
      "no number), unit, source (published, ours, set-up), text, and node_only: whether cell_node "
      "alone has it.");

  m.def(
      "arm_terms",
      [](const std::string& urdf, const Vector7& position, const Vector7& velocity) {
        ArmModel model(urdf);
        ArmTerms terms;
        model.evaluate(position, velocity, terms);
        py::dict result;
        result["mass"] = Matrix7(terms.mass);
        result["coriolis"] = Vector7(terms.coriolis);
        result["gravity"] = Vector7(terms.gravity);
        result["jacobian"] = Matrix67(terms.jacobian);
        result["tip"] = poseDict(terms.tip);
        return result;
      },
      py::arg("urdf"), py::arg("position"), py::arg("velocity"),
      "Mass matrix, velocity and gravity torques, Jacobian (x y z rx ry rz, world axes) and pose "
      "of ih2_palm.");
}
