// Stands for plugin_library.cpp where no library is opened, so that the rest of the core can be
// instrumented without class_loader.
#include <stdexcept>

#include "ctrl_more/plugin_library.hpp"

namespace ctrl_more {

struct PluginLibrary::Handle {};
PluginLibrary::~PluginLibrary() = default;

ControllerInstance makeController(const std::string&, const std::string&) {
  throw std::runtime_error("this program opens no libraries");
}

SearchPath::SearchPath(std::string base, std::vector<std::string> extra)
    : base_(std::move(base)), extra_(std::move(extra)) {}
std::string SearchPath::find(const std::string& name) const {
  throw std::runtime_error("this program looks for no files: " + name);
}
std::string SearchPath::findLibraryOf(const std::string& type) const { return find(type); }

}  // namespace ctrl_more
