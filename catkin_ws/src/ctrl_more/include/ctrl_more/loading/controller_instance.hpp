#pragma once

#include <memory>
#include <string>

#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/plugin_library.hpp"

namespace ctrl_more {

/// A controller and the library with its code. The controller is destroyed before the library.
struct ControllerInstance {
  std::shared_ptr<PluginLibrary> library;          ///< null for code linked into the program
  std::unique_ptr<FeedbackController> controller;  ///< declared second, so destroyed first

  /// Empty.
  ControllerInstance() = default;
  /// Takes ownership of both.
  ControllerInstance(ControllerInstance&&) = default;
  ControllerInstance& operator=(ControllerInstance&&) = delete;
  ~ControllerInstance() { controller.reset(); }
};

/// Makes a controller of a type.
/// @param library_path file; "": the type is linked into the program. Of a script type: the folder
///        of its module
/// @param type registered name; "": the only one in the library; `module:Class` for a script type
/// @throws std::runtime_error with one sentence
ControllerInstance makeController(const std::string& library_path, const std::string& type);

}  // namespace ctrl_more
