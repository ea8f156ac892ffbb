/// @file
/// Motion controller that runs a class derived from Motion<> (motion/motion.hpp), and the macro
/// that registers such a class.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/motion/motion_runner.hpp"

namespace coglab_controllers {

/// Arguments of start_motion.
struct MotionRequestByName {
  std::vector<std::string> names;  ///< given arguments; the others take their defaults
  std::vector<double> values;      ///< one for each name, in the unit that the motion declared
  bool queue = false;              ///< true: start after the current motion; false: replace it
};

/// ABI numbers of the compiled file, for libraries of motions: those of the classes that
/// motionAbi() does not cover. The first number is raised when meanings change. The function is
/// static, so that each library keeps its own.
static inline constexpr ctrl_more::Abi customMotionAbi() {
  return ctrl_more::abiOf<Motion<>, MotionConfiguration, MotionArgument, MotionArguments,
                          MotionStart<>, SetPoint, MotionCycle, IkResult, MotionReference>(2);
}

/// Runs any Motion<>. Parameters: those of MotionRunner, and one for the default of each argument.
class CustomMotionController : public MotionRunner<MotionArguments> {
 public:
  /// Makes a controller for a motion from a library. It is made here, because the library may have
  /// been compiled with another size of this class.
  /// @param motion the motion to run
  /// @param library ABI of the caller; use the default
  /// @throws std::runtime_error if the program was compiled with another ABI
  static MotionController* make(std::unique_ptr<Motion<>> motion,
                                const ctrl_more::Abi& library = customMotionAbi());
  ~CustomMotionController() override;

  /// Handles start_motion. Any thread.
  MotionAnswer startMotion(const MotionRequestByName& request);
  /// Name, unit, default and range of each argument of start_motion, one line each.
  std::string describeArguments() const;
  /// Newest progress; one reader thread.
  bool readProgress(MotionProgress& progress) { return progress_.read(progress); }

 private:
  explicit CustomMotionController(std::unique_ptr<Motion<>> motion);
  void report(std::int64_t stamp_ns) override;
  Answer readArguments(const MotionRequestByName& request, MotionArguments& values) const;

  TripleBuffer<MotionProgress> progress_;
};

}  // namespace coglab_controllers

/// Registers a class derived from Motion<> from one of its library's source files, outside of any
/// namespace: `COGLAB_REGISTER_MOTION("wave/Wave", Wave)`. If the library is lib<name>.so and the
/// type <name>/…, load_controller finds the library by the type.
#define COGLAB_REGISTER_MOTION(type, Class)                                                    \
  namespace {                                                                                  \
  const ::coglab_controllers::MotionRegistration coglab_motion_registration(                   \
      type,                                                                                    \
      {[]() -> ::coglab_controllers::MotionController* {                                       \
         return ::coglab_controllers::CustomMotionController::make(std::make_unique<Class>()); \
       },                                                                                      \
       nullptr});                                                                              \
  }
