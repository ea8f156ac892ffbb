#pragma once

#include <dlfcn.h>

namespace ctrl_more {

// What ctrl_more_probe writes, line by line: each step before it is taken, at last kProbeDone, or
// kProbeError and what is wrong.
inline constexpr int kProbeReport = 3;  ///< file descriptor it writes to
inline constexpr const char* kProbeDone = "done";
inline constexpr const char* kProbeError = "error: ";

/// dlopen() as it is: what constructors of static objects throw passes through it. Its declaration
/// denies that, and the compiler would leave out the handlers.
inline void* openLibrary(const char* file) {
  void* (*const volatile open)(const char*, int) = dlopen;
  // All functions are resolved at once: a missing one would end the process when it is called.
  return open(file, RTLD_NOW | RTLD_LOCAL);
}

}  // namespace ctrl_more
