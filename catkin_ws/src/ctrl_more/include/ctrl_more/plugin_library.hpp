#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// One loaded controller library. Stays loaded while anything holds it; instances must be
/// destroyed before (ControllerInstance sees to that).
class PluginLibrary {
 public:
  /// Loads a library, or returns the one that is loaded already.
  /// @param path file
  /// @throws std::runtime_error with a sentence: file missing or not loadable, no controller in
  ///         it, a type name that is registered already
  static std::shared_ptr<PluginLibrary> open(const std::string& path);

  ~PluginLibrary();
  PluginLibrary(const PluginLibrary&) = delete;
  PluginLibrary& operator=(const PluginLibrary&) = delete;

  /// File the library came from.
  const std::string& path() const { return path_; }

  /// Controller types it registers, sorted.
  const std::vector<std::string>& types() const { return types_; }

 private:
  struct Handle;
  PluginLibrary() = default;
  std::string path_;
  std::vector<std::string> types_;
  std::unique_ptr<Handle> handle_;
};

/// A controller together with the library its code lives in; destroyed in the right order.
struct ControllerInstance {
  std::shared_ptr<PluginLibrary> library;           ///< null for code linked into the program
  std::unique_ptr<FeedbackController> controller;  ///< declared after, so destroyed first

  /// Holds nothing.
  ControllerInstance() = default;
  /// Takes over both.
  ControllerInstance(ControllerInstance&&) = default;
  ControllerInstance& operator=(ControllerInstance&&) = delete;
  ~ControllerInstance() { controller.reset(); }
};

/// Makes a controller of a type.
/// @param library_path file; "": the type must be linked into the program already
/// @param type registered name; "": the only one in the library
/// @throws std::runtime_error with a sentence
ControllerInstance makeController(const std::string& library_path, const std::string& type);

/// Where libraries and configuration files are looked for, so that no absolute path is needed.
///
/// In this order: absolute paths as they are; `package://name/rest` below ROS_PACKAGE_PATH and
/// CMAKE_PREFIX_PATH; relative to the file that names them; the folders given by the user
/// (`searchPath` in the list file, CTRL_MORE_PATH in the environment); the folder of the core
/// library, `lib` of each CMAKE_PREFIX_PATH entry, `share/ctrl_more/config` beside it.
class SearchPath {
 public:
  /// @param base folder of the file that names others
  /// @param extra folders of the list file's `searchPath`
  explicit SearchPath(std::string base, std::vector<std::string> extra = {});

  /// The file a name stands for; throws std::runtime_error listing the places tried.
  std::string find(const std::string& name) const;

  /// The library of a type when the list file gives no `libPath`: `lib<Type>.so`,
  /// `libfbkCtrl<Type>.so`, `lib<type_in_snake_case>.so` or `libctrl_more_<type_in_snake_case>.so`;
  /// throws std::runtime_error.
  std::string findLibraryOf(const std::string& type) const;

 private:
  std::vector<std::string> candidates(const std::string& name) const;
  std::string base_;
  std::vector<std::string> extra_;
};

}  // namespace ctrl_more
