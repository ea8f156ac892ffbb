#pragma once

#include <string>
#include <vector>

namespace ctrl_more {

/// Finds libraries and configuration files, so that no absolute path is needed.
///
/// Search order: absolute paths as they are; `package://name/rest` below ROS_PACKAGE_PATH and
/// CMAKE_PREFIX_PATH; relative to the file that contains the name; the user's folders
/// (`searchPath` in the list file, CTRL_MORE_PATH in the environment); the folder of the core
/// library, `lib` of each CMAKE_PREFIX_PATH entry, `share/ctrl_more/config` beside it.
class SearchPath {
 public:
  /// @param base folder of the file that contains the names
  /// @param extra folders of the list file's `searchPath`
  explicit SearchPath(std::string base, std::vector<std::string> extra = {});

  /// Path of the file of a name. Throws std::runtime_error with the places that were tried.
  std::string find(const std::string& name) const;

  /// Library of a type if the list file gives no `libPath`: `lib<Type>.so`, `libfbkCtrl<Type>.so`,
  /// `lib<type_in_snake_case>.so` or `libctrl_more_<type_in_snake_case>.so`.
  /// Throws std::runtime_error.
  std::string findLibraryOf(const std::string& type) const;

 private:
  std::vector<std::string> candidates(const std::string& name) const;
  std::string base_;
  std::vector<std::string> extra_;
};

/// Folder of the ctrl_more library, or of the program that contains it.
std::string coreFolder();

}  // namespace ctrl_more
