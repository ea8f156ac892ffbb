// Libraries with an arm, good and bad, by a definition of the compiler.
#include <stdexcept>

#include "coglab_rt/arm_library.hpp"
#include "example/shortest_arm.hpp"

#if defined(ARM_shortest)
COGLAB_ARM(ShortestArm);
#elif defined(ARM_throwing)
struct ThrowingArm : ShortestArm {
  ThrowingArm() { throw std::runtime_error("no cable is plugged in"); }
};
COGLAB_ARM(ThrowingArm);
#elif defined(ARM_other_version)
namespace {
constexpr coglab_rt::ArmEntry entry() {
  coglab_rt::ArmEntry other = coglab_rt::armEntry<ShortestArm>();
  other.interface = 999;
  return other;
}
}  // namespace
extern "C" __attribute__((visibility("default"))) const coglab_rt::ArmEntry coglab_arm;
extern "C" const coglab_rt::ArmEntry coglab_arm = entry();
#endif
