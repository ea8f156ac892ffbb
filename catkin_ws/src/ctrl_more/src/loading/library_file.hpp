#pragma once

#include <dlfcn.h>

#include <string>

namespace ctrl_more {

// Report of ctrl_more_probe, line by line: each step before it begins, then kProbeDone, or
// kProbeError with the error.
inline constexpr int kProbeReport = 3;  ///< file descriptor of the report
inline constexpr const char* kProbeDone = "done";
inline constexpr const char* kProbeError = "error: ";

/// Calls dlopen() through a pointer. Constructors of static objects can throw through dlopen(), but
/// its declaration excludes that, so the compiler would omit the exception handlers.
inline void* openLibrary(const char* file) {
  void* (*const volatile open)(const char*, int) = dlopen;
  // Resolves all functions now, because a call of a missing one would end the process.
  return open(file, RTLD_NOW | RTLD_LOCAL);
}

/// A private copy of a library's file, which exists while the library is opened. Later changes of
/// the user's file, such as a rebuild, then do not affect the running program.
class LibraryCopy {
 public:
  /// Copies the file into a hidden file of the same folder, so that `$ORIGIN` stays the same. If
  /// that is not possible, path() is the file itself.
  explicit LibraryCopy(const std::string& file);
  /// Removes the copy. Its mapped parts stay in memory.
  ~LibraryCopy();
  LibraryCopy(const LibraryCopy&) = delete;
  LibraryCopy& operator=(const LibraryCopy&) = delete;

  /// Path of the file to open.
  const std::string& path() const { return path_; }

  /// Refuses a library that could end or block the program. The file must have the length in its
  /// headers. Then the program `ctrl_more_probe` opens it, makes each of its controllers (feedback
  /// and motion), calls describe() of the feedback controllers and closes it.
  /// @throws std::runtime_error with the error of the library
  void check() const;

 private:
  void probe() const;

  std::string file_, path_;
};

}  // namespace ctrl_more
