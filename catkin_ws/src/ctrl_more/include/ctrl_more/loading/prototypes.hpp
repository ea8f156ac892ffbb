#pragma once

#include <string>
#include <utility>

#include "ctrl_more/controller/feedback_controller.hpp"
#include "ctrl_more/loading/plugin_types.hpp"

namespace ctrl_more {

/// The numbers of the file that is being compiled, for libraries of feedback controllers. The first
/// one is raised when classes or meanings change. Static, so that a library keeps its own.
static inline constexpr Abi thisAbi() {
  return abiOf<FeedbackController, RobotStates, ControlStates, ModifiedControlStates, Description,
               RobotSignalUse, ControlSignalUse, GainSpec, SettingSpec, StateSpec, Setup, Numbers<>,
               Cycle>(4);
}

/// Makes one controller; the caller owns it. The paper's type for its prototypes.
using FeedbackControllerMaker = FeedbackController* (*)();

/// The shared map of controller types (Ctrl-MORE paper, section V-B): every plug-in library puts
/// its makers in when it is loaded. Unlike a plain map it remembers refused insertions, so that a
/// library which registers a known name is told so.
class FeedbackControllerPrototypes : public PluginTypesOf<FeedbackControllerMaker> {
 public:
  /// No types.
  FeedbackControllerPrototypes();

  /// Registers a maker under a type name, as the paper's listing does:
  /// `feedbackControllerPrototypes.insert({"MyController", feedbackExampleMaker});`
  /// @param entry type name and maker
  /// @param abi what the caller was compiled with; leave it out
  /// @return false, and a note for the loader, if the name is known already or the ABI is another
  ///         one
  bool insert(const std::pair<const std::string, FeedbackControllerMaker>& entry,
              const Abi& abi = thisAbi());
};

/// The map itself, one per process. A function, so that it exists before any library's static
/// objects run.
FeedbackControllerPrototypes& prototypes();

/// The same under the name that the paper's listing uses.
[[maybe_unused]] static FeedbackControllerPrototypes& feedbackControllerPrototypes = prototypes();

/// Registers for as long as the library is loaded. Used by the macro below.
class PrototypeRegistration {
 public:
  /// Inserts.
  PrototypeRegistration(const char* type, FeedbackControllerMaker maker, const Abi& abi = thisAbi())
      : type_(type), maker_(maker) {
    prototypes().insert({type_, maker_}, abi);
  }
  /// Erases.
  ~PrototypeRegistration() { prototypes().erase(type_, maker_); }
  PrototypeRegistration(const PrototypeRegistration&) = delete;
  PrototypeRegistration& operator=(const PrototypeRegistration&) = delete;

 private:
  std::string type_;
  FeedbackControllerMaker maker_;
};

}  // namespace ctrl_more

/// Registers a controller class from its source file:
/// `CTRL_MORE_REGISTER_CONTROLLER(my_lab::WristDamper, "WristDamper")`. The name must be the one
/// in describe().type. Use it once per library, outside of any namespace.
#define CTRL_MORE_REGISTER_CONTROLLER(Class, type)                                       \
  namespace {                                                                            \
  ::ctrl_more::FeedbackController* ctrlMoreMaker() { return new Class(); }               \
  const ::ctrl_more::PrototypeRegistration ctrl_more_registration(type, &ctrlMoreMaker); \
  }
