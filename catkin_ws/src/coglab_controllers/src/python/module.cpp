#include "bindings.hpp"

PYBIND11_MODULE(_core, module) {
  module.doc() = "The code of coglab_controllers that runs in the robot's control cycle.";
  coglab_controllers::python::bindDmp(module);
  coglab_controllers::python::bindMotion(module);
  coglab_controllers::python::bindArm(module);
  coglab_controllers::python::bindLimits(module);
}
