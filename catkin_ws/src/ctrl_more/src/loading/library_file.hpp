#pragma once

#include <dlfcn.h>

#include <string>

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

/// A private copy of a library's file, for as long as it takes to open it. Later changes of the
/// user's file, such as a rebuild that overwrites it, do not reach the running program.
class LibraryCopy {
 public:
  /// Copies the file into a hidden file of the same folder, where `$ORIGIN` means the same. Where
  /// that is not possible, path() is the file itself.
  explicit LibraryCopy(const std::string& file);
  /// Removes the copy. What is mapped of it stays.
  ~LibraryCopy();
  LibraryCopy(const LibraryCopy&) = delete;
  LibraryCopy& operator=(const LibraryCopy&) = delete;

  /// What to open.
  const std::string& path() const { return path_; }

  /// Refuses a library that could end or block the program which opens it. The file has to be as
  /// long as its headers claim. Then the program `ctrl_more_probe` opens and closes it, makes each
  /// feedback controller of it and asks for its description.
  /// @throws std::runtime_error what is wrong with the library
  void check() const;

 private:
  void checkLength() const;
  void probe() const;

  std::string file_, path_;
};

}  // namespace ctrl_more
