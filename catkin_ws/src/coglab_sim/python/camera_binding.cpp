/// Python module coglab_sim._camera: pictures of a simulated cell, drawn without a screen.
#include <pybind11/numpy.h>

#include "coglab_sim/camera.hpp"
#include "py_cell.hpp"

namespace py = pybind11;
using namespace coglab_sim;
using namespace coglab_sim::python;

namespace {

using Rgb = std::array<float, 3>;

/// The camera and its cell.
struct CellCamera {
  CellCamera(PyCell& cell, int width, int height)
      : cell(cell), camera(*cell.cell().plant().model().get(), width, height) {}

  py::array_t<std::uint8_t> draw() {
    const auto& pixels = camera.draw(*cell.cell().plant().model().data());
    return py::array_t<std::uint8_t>({camera.height(), camera.width(), 3}, pixels.data());
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
      .def("draw", &CellCamera::draw, "The picture now: an array height x width x 3 of bytes.")
      .def(
          "depth",
          [](const CellCamera& c) {
            const auto depth = c.camera.depth();
            return py::array_t<float>({c.camera.height(), c.camera.width()}, depth.data());
          },
          "Distance of each pixel of the last picture from the camera's plane, m.");
}
