#pragma once

#include <functional>
#include <memory>
#include <string>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// Makes a controller that is written in a script language. The program sets it (the Python module
/// does), so that this library depends on no such language.
/// @param type `module:Class`
/// @param folder folder of the list file, where modules are looked for first
/// @throws std::runtime_error with one sentence
using ScriptLoader = std::function<std::unique_ptr<FeedbackController>(const std::string& type,
                                                                       const std::string& folder)>;

/// Sets or replaces the loader of all managers of the program; empty: none. Any thread.
void setScriptLoader(ScriptLoader loader);

/// True for a type of a script language: it has a colon, as `my_module:MyController`.
inline bool isScriptType(const std::string& type) { return type.find(':') != std::string::npos; }

/// Makes a controller by the loader. Throws std::runtime_error with one sentence, also if no loader
/// is set.
std::unique_ptr<FeedbackController> makeScriptController(const std::string& type,
                                                         const std::string& folder);

}  // namespace ctrl_more
