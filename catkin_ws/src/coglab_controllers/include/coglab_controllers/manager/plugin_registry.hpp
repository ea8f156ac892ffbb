/// @file
/// Which motion controller types exist in this process, and how they get into it from shared
/// objects.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "coglab_controllers/manager/motion_controller.hpp"

namespace coglab_controllers {

class MotionControllerRos;

/// How to make a controller of one type.
struct MotionMaker {
  MotionController* (*controller)() = nullptr;  ///< the caller owns the result
  MotionControllerRos* (*ros)() = nullptr;      ///< its ROS side; null: it has none
};

/// The types that libraries have registered. Unlike class_loader's own map, in which a second
/// registration of a name silently replaces the first, it refuses one and remembers that, so that
/// the library can be refused as a whole.
///
/// Any thread.
class MotionTypes {
 public:
  static MotionTypes& instance();

  /// Registers a type; returns false, and remembers the refusal, if the name is known.
  bool insert(const std::string& type, const MotionMaker& maker);
  /// Removes a type if it is this maker's.
  void erase(const std::string& type, const MotionMaker& maker);
  /// Maker of a type, if it is known.
  std::optional<MotionMaker> find(const std::string& type) const;
  /// Known type names, sorted.
  std::vector<std::string> names() const;
  /// Names refused since the last call.
  std::vector<std::string> takeRefused();

 private:
  mutable std::mutex mutex_;
  std::map<std::string, MotionMaker> makers_;
  std::vector<std::string> refused_;
};

/// Registers a type for as long as its library is loaded; used by the macro below.
class MotionRegistration {
 public:
  MotionRegistration(const char* type, const MotionMaker& maker) : type_(type), maker_(maker) {
    MotionTypes::instance().insert(type_, maker_);
  }
  ~MotionRegistration() { MotionTypes::instance().erase(type_, maker_); }
  MotionRegistration(const MotionRegistration&) = delete;
  MotionRegistration& operator=(const MotionRegistration&) = delete;

 private:
  std::string type_;
  MotionMaker maker_;
};

/// A shared object with motion controllers, loaded by class_loader; stays loaded while anything
/// holds it.
class MotionLibrary {
 public:
  /// Loads a library, or returns it if it is loaded already.
  /// @throws std::runtime_error with a sentence: the file is missing or not loadable, registers no
  /// type, or registers a
  ///         type that is known already (then it is unloaded again and what was there stays as it
  ///         was)
  static std::shared_ptr<MotionLibrary> open(const std::string& path);

  ~MotionLibrary();
  MotionLibrary(const MotionLibrary&) = delete;
  MotionLibrary& operator=(const MotionLibrary&) = delete;

  const std::string& path() const { return path_; }
  /// Types that it registers, sorted.
  const std::vector<std::string>& types() const { return types_; }

 private:
  struct Handle;
  MotionLibrary() = default;
  std::string path_;
  std::vector<std::string> types_;
  std::unique_ptr<Handle> handle_;
};

/// Finds a library by its name: absolute paths as they are, else in `folders`, in the folder of
/// this library, and in `lib` of every entry of CMAKE_PREFIX_PATH. @throws std::runtime_error
/// listing the places.
std::string findLibrary(const std::string& name, const std::vector<std::string>& folders);

}  // namespace coglab_controllers

/// Registers a motion controller from one of its library's source files, outside of any namespace:
/// `COGLAB_REGISTER_MOTION_CONTROLLER("my_lab/Wiggle", my_lab::Wiggle)`.
#define COGLAB_REGISTER_MOTION_CONTROLLER(type, Class)                                           \
  namespace {                                                                                    \
  const ::coglab_controllers::MotionRegistration coglab_motion_registration(                     \
      type, {[]() -> ::coglab_controllers::MotionController* { return new Class(); }, nullptr}); \
  }

/// The same for a controller with a ROS side.
#define COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS(type, Class, RosClass)                     \
  namespace {                                                                                 \
  const ::coglab_controllers::MotionRegistration coglab_motion_registration(                  \
      type, {[]() -> ::coglab_controllers::MotionController* { return new Class(); },         \
             []() -> ::coglab_controllers::MotionControllerRos* { return new RosClass(); }}); \
  }
