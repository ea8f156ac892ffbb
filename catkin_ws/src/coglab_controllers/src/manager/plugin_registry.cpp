#include "coglab_controllers/manager/plugin_registry.hpp"

namespace coglab_controllers {

MotionTypes::MotionTypes()
    : PluginTypesOf("motion controller", "COGLAB_REGISTER_MOTION_CONTROLLER", "coglab_controllers",
                    motionAbi()) {}

MotionTypes& MotionTypes::instance() {
  static MotionTypes types;
  return types;
}

bool MotionTypes::insert(const std::string& type, const MotionMaker& maker,
                         const ctrl_more::Abi& abi) {
  return add(type, maker, abi);
}

}  // namespace coglab_controllers
