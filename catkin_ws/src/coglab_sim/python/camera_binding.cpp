/// Python module coglab_sim._camera: pictures of a simulated cell, drawn without a screen.
#include <pybind11/numpy.h>

#include "coglab_sim/camera.hpp"
#include "py_cell.hpp"

namespace py = pybind11;
using namespace coglab_sim;
using namespace coglab_sim::python;

namespace {

using Rgb = std::array<float, 3>;

/// Motor that moves a phalanx, by the phalanx's name.
std::size_t motorOf(const std::string& phalanx) {
  const auto has = [&](const char* word) { return phalanx.find(word) != std::string::npos; };
  if (has("thumb_base")) return 0;
  if (has("thumb")) return 1;
  if (has("index")) return 2;
  return has("middle") ? 3 : 4;
}

/// The camera and its cell.
struct CellCamera {
  CellCamera(PyCell& cell, int width, int height)
      : cell(cell), camera(*cell.cell().plant().model().get(), width, height) {}

  py::array_t<std::uint8_t> draw() {
    const auto& pixels = camera.draw(*cell.cell().plant().model().data());
    return py::array_t<std::uint8_t>({camera.height(), camera.width(), 3}, pixels.data());
  }

  /// Sets arm, fingers and object to a recorded state. Only pictures are valid afterwards: forces
  /// and the robot controller do not follow.
  void pose(const Vector7& arm, const std::array<double, 5>& fingers, const Pose& object) {
    auto& model = cell.cell().plant().model();
    mjModel* m = model.get();
    mjData* d = model.data();
    for (std::size_t i = 0; i < 7; ++i)
      d->qpos[model.arm_position[i]] = arm[static_cast<Eigen::Index>(i)];
    for (std::size_t i = 0; i < model.phalanges.size(); ++i) {
      const int joint = m->body_jntadr[model.phalanges[i]];
      const std::size_t motor = motorOf(mj_id2name(m, mjOBJ_BODY, model.phalanges[i]));
      const mjtNum low = m->jnt_range[2 * joint], high = m->jnt_range[2 * joint + 1];
      d->qpos[model.phalanx_position[i]] = low + fingers[motor] * (high - low);
    }
    mjtNum* q = d->qpos + model.object_position;
    for (Eigen::Index i = 0; i < 3; ++i) q[i] = object.position[i];
    q[3] = object.rotation.w();
    q[4] = object.rotation.x();
    q[5] = object.rotation.y();
    q[6] = object.rotation.z();
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_camlight(m, d);
  }

  PyCell& cell;
  Camera camera;
};

}  // namespace

PYBIND11_MODULE(_camera, m) {
  m.doc() =
      "Pictures of a simulated cell, drawn without a screen. Colours: red, green, blue, 0..1.";
  py::module_::import("coglab_sim._cell");  // registers the type of the cell

  py::class_<CellCamera>(
      m, "Camera",
      "An off-screen camera on a cell (coglab_sim._cell.Cell, or LockstepRobot.cell). "
      "Use it in the thread that made it.")
      .def(py::init<PyCell&, int, int>(), py::arg("cell"), py::arg("width") = 640,
           py::arg("height") = 480, py::keep_alive<1, 2>())
      .def(
          "set_colour",
          [](CellCamera& c, const std::string& body, const Rgb& rgb, float opacity) {
            c.camera.setColour(body, {rgb[0], rgb[1], rgb[2], opacity});
          },
          py::arg("body"), py::arg("rgb"), py::arg("opacity") = 1.0F,
          "Colour of all solids of a body; opacity 0 hides them.")
      .def(
          "look",
          [](CellCamera& c, const Vector3d& at, double distance, double azimuth, double elevation) {
            c.camera.look(at, distance, azimuth, elevation);
          },
          py::arg("at"), py::arg("distance"), py::arg("azimuth"), py::arg("elevation"),
          "Looks at a point in the world (m) from a distance (m); angles in degrees.")
      .def(
          "set_field_of_view", [](CellCamera& c, double angle) { c.camera.setFieldOfView(angle); },
          py::arg("angle"), "Vertical, degrees.")
      .def(
          "add",
          [](CellCamera& c, const std::string& shape, const Vector3d& size,
             const Vector3d& position, const Eigen::Vector4d& rotation, const Rgb& rgb) {
            c.camera.add(shape, size, makePose(position, rotation), {rgb[0], rgb[1], rgb[2], 1.0F});
          },
          py::arg("shape"), py::arg("size"), py::arg("position"), py::arg("rotation"),
          py::arg("rgb"),
          "Adds a sphere, capsule, ellipsoid, cylinder or box to the next picture; half sizes, m.")
      .def(
          "pose",
          [](CellCamera& c, const Vector7& arm, const std::array<double, 5>& fingers,
             const Vector3d& object,
             const Eigen::Vector4d& rotation) { c.pose(arm, fingers, makePose(object, rotation)); },
          py::arg("arm"), py::arg("fingers"), py::arg("object"), py::arg("rotation"),
          "Puts arm (7 joints, rad), fingers (five motors, 0 open .. 1 closed) and object (m, x y "
          "z "
          "w) into place for the next picture. For recordings: the cell is of no use afterwards.")
      .def("draw", &CellCamera::draw, "The picture now: an array height x width x 3 of bytes.")
      .def(
          "depth",
          [](const CellCamera& c) {
            const auto depth = c.camera.depth();
            return py::array_t<float>({c.camera.height(), c.camera.width()}, depth.data());
          },
          "Distance of each pixel of the last picture from the camera's plane, m.");
}
