#include "coglab_controllers/manager/plugin_registry.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <sstream>
#include <stdexcept>

#include <class_loader/class_loader.hpp>

namespace coglab_controllers {

namespace {

std::mutex& loaderMutex() {
  static std::mutex mutex;
  return mutex;
}

std::map<std::string, std::weak_ptr<MotionLibrary>>& openLibraries() {
  static std::map<std::string, std::weak_ptr<MotionLibrary>> libraries;
  return libraries;
}

/// What libraries registered when they were first loaded. The dynamic linker may keep one mapped
/// after it was unloaded; loaded again, it then registers nothing anew.
std::map<std::string, std::vector<std::string>>& registeredOnce() {
  static std::map<std::string, std::vector<std::string>> types;
  return types;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string folderOfThisLibrary() {
  Dl_info info;
  if (dladdr(reinterpret_cast<const void*>(&folderOfThisLibrary), &info) == 0) return "";
  return std::filesystem::path(info.dli_fname).parent_path().string();
}

}  // namespace

MotionTypes& MotionTypes::instance() {
  static MotionTypes types;
  return types;
}

bool MotionTypes::insert(const std::string& type, const MotionMaker& maker) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (makers_.emplace(type, maker).second) return true;
  refused_.push_back(type);
  return false;
}

void MotionTypes::erase(const std::string& type, const MotionMaker& maker) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = makers_.find(type);
  if (found != makers_.end() && found->second.controller == maker.controller) makers_.erase(found);
}

std::optional<MotionMaker> MotionTypes::find(const std::string& type) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = makers_.find(type);
  if (found == makers_.end()) return std::nullopt;
  return found->second;
}

std::vector<std::string> MotionTypes::names() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::string> names;
  for (const auto& entry : makers_) names.push_back(entry.first);
  return names;
}

std::vector<std::string> MotionTypes::takeRefused() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::string> refused;
  refused.swap(refused_);
  return refused;
}

struct MotionLibrary::Handle {
  explicit Handle(const std::string& path) : loader(path, false) {}
  class_loader::ClassLoader loader;
};

std::shared_ptr<MotionLibrary> MotionLibrary::open(const std::string& path) {
  const std::lock_guard<std::mutex> lock(loaderMutex());
  const std::string key = std::filesystem::weakly_canonical(path).string();
  if (std::shared_ptr<MotionLibrary> open = openLibraries()[key].lock()) return open;
  if (!std::filesystem::exists(key)) {
    throw std::runtime_error("library '" + path +
                             "' does not exist; expected a shared object with motion "
                             "controllers; check the path, and that its package is built");
  }
  MotionTypes& types = MotionTypes::instance();
  const std::vector<std::string> before = types.names();
  types.takeRefused();
  std::shared_ptr<MotionLibrary> library(new MotionLibrary());
  library->path_ = key;
  try {
    library->handle_ = std::make_unique<Handle>(key);
  } catch (const std::exception& error) {
    throw std::runtime_error(
        "library '" + path + "' cannot be loaded: " + error.what() +
        "; expected a shared object built as a MODULE against coglab_controllers");
  }
  const std::vector<std::string> known = types.names();
  std::vector<std::string> refused = types.takeRefused();
  std::vector<std::string> added;
  std::set_difference(known.begin(), known.end(), before.begin(), before.end(),
                      std::back_inserter(added));
  std::vector<std::string>& once = registeredOnce()[key];
  if (added.empty() && refused.empty()) {
    for (const std::string& type : once) {
      (std::binary_search(known.begin(), known.end(), type) ? added : refused).push_back(type);
    }
  } else {
    once = added;
    once.insert(once.end(), refused.begin(), refused.end());
  }
  if (!refused.empty()) {
    library->handle_.reset();  // takes its other registrations with it
    throw std::runtime_error("library '" + path + "' registers type '" + joined(refused) +
                             "', which another library has registered already; rename one of the "
                             "two types");
  }
  if (added.empty()) {
    library->handle_.reset();
    throw std::runtime_error("library '" + path +
                             "' registers no motion controller; expected at least one "
                             "COGLAB_REGISTER_MOTION_CONTROLLER in its sources");
  }
  library->types_ = added;
  openLibraries()[key] = library;
  return library;
}

MotionLibrary::~MotionLibrary() = default;

std::string findLibrary(const std::string& name, const std::vector<std::string>& folders) {
  namespace fs = std::filesystem;
  if (fs::path(name).is_absolute()) return name;
  std::vector<std::string> places = folders;
  places.push_back(folderOfThisLibrary());
  if (const char* prefixes = std::getenv("CMAKE_PREFIX_PATH")) {
    std::istringstream list(prefixes);
    for (std::string prefix; std::getline(list, prefix, ':');) places.push_back(prefix + "/lib");
  }
  for (const std::string& place : places) {
    const fs::path candidate = fs::path(place) / name;
    if (!place.empty() && fs::exists(candidate)) return candidate.string();
  }
  throw std::runtime_error(
      "library '" + name + "' was not found in: " + joined(places) +
      "; build its package, or give an absolute path or the parameter plugin_paths");
}

}  // namespace coglab_controllers
