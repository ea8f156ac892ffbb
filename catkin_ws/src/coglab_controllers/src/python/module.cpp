#include "bindings.hpp"

PYBIND11_MODULE(_core, module) {
  module.doc() = "The cores of coglab_controllers, as they run in the robot's control cycle.";
  coglab_controllers::python::bindDmp(module);
  coglab_controllers::python::bindMotion(module);
  coglab_controllers::python::bindArm(module);
  coglab_controllers::python::bindLimits(module);
}
