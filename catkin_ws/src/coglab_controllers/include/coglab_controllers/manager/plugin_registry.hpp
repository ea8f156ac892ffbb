/// @file
/// Registry of the motion controller types in this process. ctrl_more::PluginLibrary opens
/// libraries with further types, as for feedback controllers.
#pragma once

#include <string>

#include "coglab_controllers/manager/motion_controller.hpp"
#include "ctrl_more/loading/plugin_types.hpp"

namespace coglab_controllers {

class MotionControllerRos;

/// Factory functions of one controller type.
struct MotionMaker {
  MotionController* (*controller)() = nullptr;  ///< the caller owns the result
  MotionControllerRos* (*ros)() = nullptr;      ///< makes its ROS side; null: none

  /// True if the functions are the same.
  bool operator==(const MotionMaker& other) const {
    return controller == other.controller && ros == other.ros;
  }
};

/// ABI numbers of the compiled file, for libraries of motion controllers. The first number is
/// raised when classes or meanings change. The function is static, so that each library keeps its
/// own.
static inline constexpr ctrl_more::Abi motionAbi() {
  return ctrl_more::abiOf<MotionController, MotionSetup, CycleInput, References, MotionRequest,
                          RobotSample, RobotSetup, Reason>(3);
}

/// The types that libraries have registered. A name that exists is refused. Any thread.
class MotionTypes : public ctrl_more::PluginTypesOf<MotionMaker> {
 public:
  static MotionTypes& instance();

  /// Registers a type. Returns false, and stores the refusal, if the name exists or the library was
  /// compiled with other headers.
  bool insert(const std::string& type, const MotionMaker& maker,
              const ctrl_more::Abi& abi = motionAbi()) {
    return add(type, maker, abi);
  }

  /// Makes a controller and destroys it. It is not configured.
  void tryOne(const std::string& type) const override;

 private:
  MotionTypes();
};

/// Registers a type for as long as its library is loaded; used by the macro below.
class MotionRegistration {
 public:
  MotionRegistration(const char* type, const MotionMaker& maker,
                     const ctrl_more::Abi& abi = motionAbi())
      : type_(type), maker_(maker) {
    MotionTypes::instance().insert(type_, maker_, abi);
  }
  ~MotionRegistration() { MotionTypes::instance().erase(type_, maker_); }
  MotionRegistration(const MotionRegistration&) = delete;
  MotionRegistration& operator=(const MotionRegistration&) = delete;

 private:
  std::string type_;
  MotionMaker maker_;
};

}  // namespace coglab_controllers

// Two levels, so that the counter becomes a number before it is joined to the name.
#define COGLAB_MOTION_NAME_(number) coglab_motion_registration_##number
#define COGLAB_MOTION_NAME(number) COGLAB_MOTION_NAME_(number)

/// Registers a motion controller from one of its library's source files, outside of any namespace:
/// `COGLAB_REGISTER_MOTION_CONTROLLER("my_lab/Wiggle", my_lab::Wiggle)`.
#define COGLAB_REGISTER_MOTION_CONTROLLER(type, Class)                                           \
  namespace {                                                                                    \
  const ::coglab_controllers::MotionRegistration COGLAB_MOTION_NAME(__COUNTER__)(                \
      type, {[]() -> ::coglab_controllers::MotionController* { return new Class(); }, nullptr}); \
  }

/// The same for a controller with a ROS side.
#define COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS(type, Class, RosClass)                     \
  namespace {                                                                                 \
  const ::coglab_controllers::MotionRegistration COGLAB_MOTION_NAME(__COUNTER__)(             \
      type, {[]() -> ::coglab_controllers::MotionController* { return new Class(); },         \
             []() -> ::coglab_controllers::MotionControllerRos* { return new RosClass(); }}); \
  }
