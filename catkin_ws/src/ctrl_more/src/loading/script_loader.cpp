#include "ctrl_more/loading/script_loader.hpp"

#include <mutex>
#include <stdexcept>
#include <utility>

namespace ctrl_more {
namespace {

struct SharedLoader {
  std::mutex mutex;
  ScriptLoader loader;
};

SharedLoader& shared() {
  static SharedLoader the_loader;
  return the_loader;
}

}  // namespace

void setScriptLoader(ScriptLoader loader) {
  const std::lock_guard<std::mutex> lock(shared().mutex);
  shared().loader = std::move(loader);
}

std::unique_ptr<FeedbackController> makeScriptController(const std::string& type,
                                                         const std::string& folder) {
  ScriptLoader loader;
  {
    const std::lock_guard<std::mutex> lock(shared().mutex);
    loader = shared().loader;
  }
  if (!loader) {
    throw std::runtime_error("type '" + type + "' is a Python class, but this program runs no " +
                             "Python: load it from a program that imports ctrl_more");
  }
  auto controller = loader(type, folder);
  if (!controller) throw std::runtime_error("type '" + type + "': the loader returned nothing");
  return controller;
}

}  // namespace ctrl_more
