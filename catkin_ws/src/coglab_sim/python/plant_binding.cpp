/// Part of the Python module coglab_sim._cell: the physics alone, one step of at most 1 ms per
/// call.
#include "py_cell.hpp"

namespace coglab_sim::python {

using namespace coglab_sim::plant;

namespace {

Pose poseFrom(const Vector3d& position, const Eigen::Vector4d& rotation) {
  if (!position.allFinite() || !(std::abs(rotation.norm() - 1.0) < 1e-3))
    throw std::invalid_argument("a pose needs finite numbers and a quaternion x y z w of length 1");
  return {position, Quaterniond(rotation[3], rotation[0], rotation[1], rotation[2]).normalized()};
}

py::tuple pair(const Pose& pose) {
  return py::make_tuple(pose.position, Eigen::Vector4d(pose.rotation.coeffs()));
}

Object objectFrom(const py::dict& values) {
  CellConfig config;
  for (const auto& [key, value] : values)
    setCellParameter(config, "object/" + py::cast<std::string>(key),
                     py::cast<ParameterValue>(value));
  return config.object;
}

std::unique_ptr<Plant> makePlant(const std::string& urdf, const Vector7& home,
                                 const py::dict& object, std::uint64_t seed,
                                 const std::string& hand, bool board, const Drives& drives) {
  PlantConfig config;
  config.urdf = urdf;
  config.home = home;
  config.seed = seed;
  config.object = objectFrom(object);
  config.drives = drives;
  if (!hand.empty()) config.hand = readHandTable(hand);
  if (!board) config.surroundings.board_size.setZero();
  return std::make_unique<Plant>(config);
}

py::dict stateOf(const Plant& plant) {
  py::dict result;
  result["time"] = plant.time();
  result["position"] = plant.position();
  result["velocity"] = plant.velocity();
  result["palm"] = pair(plant.palm());
  result["object"] = pair(plant.object());
  result["object_velocity"] = plant.objectTwist().linear;
  result["object_spin"] = plant.objectTwist().angular;
  result["person_hand"] = pair(plant.personHand());
  result["object_force"] = Vector3d(plant.objectForce());
  result["person_force"] = Vector3d(plant.personForce());
  result["robot_share"] = plant.robotShare();
  result["person_share"] = plant.personShare();
  result["held_by"] = plant.heldBy();
  result["dropped"] = plant.dropped();
  result["contacts"] = plant.contacts();
  return result;
}

py::dict termsOf(const Plant& plant) {
  const Plant::Terms terms = plant.terms();
  py::dict result;
  result["mass"] = terms.mass;
  result["bias"] = terms.bias;
  result["jacobian"] = terms.jacobian;
  result["arm"] = terms.arm;
  result["fingers"] = terms.fingers;
  result["object"] = terms.object;
  return result;
}

/// The whole state of the simulation, for comparison byte by byte.
py::bytes bytesOf(Plant& plant) {
  const mjModel* m = plant.model().get();
  const mjData* d = plant.model().data();
  std::string bytes(reinterpret_cast<const char*>(d->qpos), sizeof(mjtNum) * m->nq);
  bytes.append(reinterpret_cast<const char*>(d->qvel), sizeof(mjtNum) * m->nv);
  return bytes;
}

}  // namespace

void definePlant(py::module_& m) {
  py::class_<Drives>(m, "Drives", "Figures of the arm's drives.")
      .def(py::init<>())
      .def_readwrite("rotor_inertia", &Drives::rotor_inertia)
      .def_readwrite("coulomb_friction", &Drives::coulomb_friction);
  py::class_<Plant>(
      m, "Plant",
      "Arm, hand with fingers, object and the person's hand, by MuJoCo; one step of at most 1 ms "
      "per step().")
      .def(py::init(&makePlant), py::arg("urdf"), py::arg("home") = Vector7(Vector7::Zero()),
           py::arg("object") = py::dict(), py::arg("seed") = 1, py::arg("hand") = "",
           py::arg("board") = true, py::arg("drives") = Drives{},
           "object: id, mass, shape, size, center, friction; hand: path of another table.")
      .def("step", &Plant::step, py::arg("motor_torque"), py::arg("dt") = kStep,
           "Nm at the joints, s.")
      .def(
          "hold",
          [](Plant& plant, const Vector7& target, const Vector7& speed, int steps) {
            // Critically damped servos at 60 rad/s with compensated bias forces, as in the cell.
            constexpr double kBandwidth = 60.0;
            for (int i = 0; i < steps; ++i) {
              const Plant::Terms terms = plant.terms();
              Vector7 torque;
              for (int j = 0; j < 7; ++j) {
                const int dof = terms.arm[static_cast<std::size_t>(j)];
                const double ahead = speed[j] * kStep * i;
                torque[j] =
                    terms.bias[dof] + terms.mass(dof, dof) * kBandwidth *
                                          (kBandwidth * (target[j] + ahead - plant.position()[j]) +
                                           2.0 * (speed[j] - plant.velocity()[j]));
              }
              plant.step(torque);
            }
          },
          py::arg("target"), py::arg("speed") = Vector7(Vector7::Zero()), py::arg("steps") = 1,
          "Steps of 1 ms with a position servo that uses the exact model: rad, rad/s.")
      .def(
          "set_person",
          [](Plant& plant, const Vector3d& position, const Eigen::Vector4d& rotation,
             const Vector3d& velocity, double grip, double grip_force) {
            plant.setPerson(
                {poseFrom(position, rotation), {velocity, Vector3d::Zero()}, grip, grip_force});
          },
          py::arg("position"), py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1),
          py::arg("velocity") = Vector3d(Vector3d::Zero()), py::arg("grip") = 0.0,
          py::arg("grip_force") = 20.0)
      .def(
          "set_push",
          [](Plant& plant, const Vector3d& force, const Vector3d& torque) {
            plant.setPush({force, torque});
          },
          py::arg("force"), py::arg("torque") = Vector3d(Vector3d::Zero()))
      .def("set_brakes", &Plant::setBrakes)
      .def("set_block", &Plant::setBlock)
      .def("set_gravity", &Plant::setGravity)
      .def("set_arm", &Plant::setArm, py::arg("position"),
           py::arg("velocity") = Vector7(Vector7::Zero()))
      .def(
          "place",
          [](Plant& plant, const std::string& where, const Vector3d& position,
             const Eigen::Vector4d& rotation) {
            plant.place(placeOf(where), poseFrom(position, rotation));
          },
          py::arg("where"), py::arg("position"), py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1))
      .def("set_object",
           [](Plant& plant, const py::dict& object) { plant.setObject(objectFrom(object)); })
      .def(
          "command_motor",
          [](Plant& plant, int motor, double target, double speed, double current) {
            if (motor < 0 || motor >= kMotors)
              throw std::invalid_argument("motor is " + std::to_string(motor) +
                                          ", expected 0 .. 4");
            plant.motors().command(motor, {speed, target, current});
          },
          py::arg("motor"), py::arg("target"), py::arg("speed") = 1.0, py::arg("current") = 1000.0,
          "target and speed: shares of the stroke and of the full speed; current: counts at which "
          "it "
          "stops.")
      .def(
          "set_motor",
          [](Plant& plant, int motor, double position) { plant.motors().set(motor, position); },
          py::arg("motor"), py::arg("position"))
      .def("state", &stateOf)
      .def("motors", [](const Plant& p) { return motorList(p); })
      .def(
          "touch", [](const Plant& p) { return touchDict(p, p.touch()); },
          "Forces on phalanges and palm, N, axes of ih2_palm.")
      .def("terms", &termsOf)
      .def("energy", &Plant::energy)
      .def("bytes", &bytesOf, "Positions and velocities of everything, as bytes.")
      .def_property_readonly("joint_torque",
                             [](const Plant& p) { return Vector7(p.jointTorque()); })
      .def_property_readonly("external_torque",
                             [](const Plant& p) { return Vector7(p.externalTorque()); });
}

}  // namespace coglab_sim::python
