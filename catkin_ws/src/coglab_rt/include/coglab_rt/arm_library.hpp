/// @file
/// An arm from a library of your own: `COGLAB_ARM(MyArm)` exports it, loadArm() makes it.
#pragma once

#include <dlfcn.h>

#include <cstdint>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/library_length.hpp"

namespace coglab_rt {

/// Number of the interface in arm_port.hpp and robot_sample.hpp. It grows with each change that a
/// library has to be compiled again for.
inline constexpr std::uint32_t kArmInterface = 1;

/// What a library exports under the name `coglab_arm`. The sizes show a library that was compiled
/// with other headers or other options.
struct ArmEntry {
  std::uint32_t interface, mailboxes_size, sample_size, command_size;
  ArmPort* (*make)();
};

/// What this program expects in an entry, without an arm.
inline constexpr ArmEntry kThisProgram = {kArmInterface, sizeof(ArmMailboxes), sizeof(RobotSample),
                                          sizeof(VelocityCommand), nullptr};

/// The entry of an arm of class `Arm`, which needs a constructor without arguments.
template <typename Arm>
constexpr ArmEntry armEntry() {
  ArmEntry entry = kThisProgram;
  entry.make = []() -> ArmPort* { return new Arm(); };
  return entry;
}

/// The file of a library as the linker finds it by its name: the first one in the folders of
/// LD_LIBRARY_PATH. A path, and a name that is not found there, is returned as it is.
inline std::string armFile(const std::string& library) {
  const char* const folders = std::getenv("LD_LIBRARY_PATH");
  if (library.find('/') != std::string::npos || folders == nullptr) return library;
  std::istringstream list(folders);
  std::error_code no_error;
  for (std::string folder; std::getline(list, folder, ':');) {
    const std::string file = (std::filesystem::path(folder) / library).string();
    if (std::filesystem::is_regular_file(file, no_error)) return file;
  }
  return library;
}

/// Opens a library and makes its arm. The library stays open until the process ends.
/// @param library path of the file, or its name where the linker finds it (LD_LIBRARY_PATH)
/// @throws std::runtime_error naming the library, what was expected and what to do
inline std::unique_ptr<ArmPort> loadArm(const std::string& library) {
  const auto refuse = [&library](const std::string& why) {
    throw std::runtime_error("the arm's library " + library + ": " + why);
  };
  // Runs code of the library: it may throw anything.
  const auto guarded = [&refuse](const auto& run) -> decltype(run()) {
    std::string why = "an exception not derived from std::exception was thrown";
    try {
      return run();
    } catch (const std::exception& error) {
      why = error.what();
    } catch (...) {
    }
    refuse("its arm could not be made: " + why +
           "; correct the cause or the constructor of the arm, and start again");
    return nullptr;
  };
  if (const std::string why = cutShort(armFile(library)); !why.empty()) refuse(why);
  // Through a pointer: constructors of static objects can throw, which the declaration of dlopen()
  // excludes.
  void* (*const volatile open)(const char*, int) = dlopen;
  void* const handle = guarded([&] { return open(library.c_str(), RTLD_NOW | RTLD_LOCAL); });
  if (handle == nullptr) {
    const char* const why = dlerror();
    refuse(std::string("cannot be opened: ") + (why != nullptr ? why : "no reason was given"));
  }
  const auto* const entry = static_cast<const ArmEntry*>(dlsym(handle, "coglab_arm"));
  if (entry == nullptr)
    refuse("has no arm; write COGLAB_ARM(YourArm) once, outside of any namespace");
  constexpr ArmEntry mine = kThisProgram;
  if (entry->interface != mine.interface) {
    refuse("was made for interface " + std::to_string(entry->interface) + " of an arm, expected " +
           std::to_string(mine.interface) + "; compile it again with coglab_rt/arm_library.hpp");
  }
  if (entry->mailboxes_size != mine.mailboxes_size || entry->sample_size != mine.sample_size ||
      entry->command_size != mine.command_size) {
    refuse(
        "was compiled with other headers or options than this program; compile it again in the "
        "same workspace");
  }
  std::unique_ptr<ArmPort> arm(guarded([entry] { return entry->make(); }));
  if (arm == nullptr) refuse("made no arm");
  return arm;
}

}  // namespace coglab_rt

/// Exports an arm from a library: once, outside of any namespace.
#define COGLAB_ARM(Arm)                                                                    \
  extern "C" __attribute__((visibility("default"))) const coglab_rt::ArmEntry coglab_arm;  \
  extern "C" __attribute__((visibility("default"))) const coglab_rt::ArmEntry coglab_arm = \
      coglab_rt::armEntry<Arm>()
