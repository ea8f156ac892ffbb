// A library that reports other headers than the program's.
#include "coglab_controllers/manager/plugin_registry.hpp"

namespace {

using namespace coglab_controllers;

ctrl_more::Abi other() {
  ctrl_more::Abi abi = motionAbi();
  ++abi.interface;
  return abi;
}

const MotionRegistration registration("test/OtherAbi",
                                      {[]() -> MotionController* { return nullptr; }, nullptr},
                                      other());

}  // namespace
