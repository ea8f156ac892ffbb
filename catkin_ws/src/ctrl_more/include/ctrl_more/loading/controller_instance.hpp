#pragma once

#include <memory>
#include <string>

#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/plugin_library.hpp"

namespace ctrl_more {

/// A controller together with the library its code lives in; destroyed in the right order.
struct ControllerInstance {
  std::shared_ptr<PluginLibrary> library;          ///< null for code linked into the program
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

}  // namespace ctrl_more
