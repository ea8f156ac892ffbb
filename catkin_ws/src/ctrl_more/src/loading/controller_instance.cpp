#include "ctrl_more/loading/controller_instance.hpp"

#include <algorithm>
#include <stdexcept>

#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/script_loader.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more {

ControllerInstance makeController(const std::string& library_path, const std::string& type) {
  ControllerInstance instance;
  if (isScriptType(type)) {
    instance.controller = makeScriptController(type, library_path);
    return instance;
  }
  std::string wanted = type;
  std::vector<std::string> known = prototypes().types();
  if (!library_path.empty()) {
    instance.library = PluginLibrary::open(library_path, prototypes());
    known = instance.library->types();
    if (wanted.empty() && known.size() > 1) {
      throw std::runtime_error("library " + library_path + " registers more than one controller (" +
                               joined(known) + "); say which with type");
    }
    if (wanted.empty()) wanted = known.front();
  }
  if (std::find(known.begin(), known.end(), wanted) == known.end()) {
    throw std::runtime_error((library_path.empty() ? "the program" : "library " + library_path) +
                             " has no controller of type '" + wanted + "'" +
                             suggestion(wanted, known));
  }
  const FeedbackControllerMaker maker = prototypes().find(wanted);
  if (!maker) throw std::runtime_error("controller type '" + wanted + "' was unloaded meanwhile");
  // An exception of the library must not leave this function, because its code is in the library.
  std::string described;
  const std::string threw = "the controller of type '" + wanted + "' threw while it was made: ";
  try {
    instance.controller.reset(maker());
    if (instance.controller) described = instance.controller->describe().type;
  } catch (const std::exception& e) {
    throw std::runtime_error(threw + e.what());
  } catch (...) {
    throw std::runtime_error(threw + "something that is not a std::exception");
  }
  if (!instance.controller) {
    throw std::runtime_error("the maker of controller type '" + wanted + "' returned nothing");
  }
  if (described != wanted) {
    throw std::runtime_error("the controller registered as '" + wanted + "' describes itself as '" +
                             described + "'; make them the same");
  }
  return instance;
}

}  // namespace ctrl_more
