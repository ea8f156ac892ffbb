// The only file that knows class_loader.
#include "ctrl_more/plugin_library.hpp"

#include <dlfcn.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <sstream>
#include <stdexcept>

#include <class_loader/class_loader.hpp>

#include "ctrl_more/config_node.hpp"
#include "ctrl_more/prototypes.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {
namespace {

// Serialises loading, and everything that touches the prototypes.
std::recursive_mutex& loaderMutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

// What tells a file from a later build under the same name.
struct Build {
  dev_t device = 0;
  ino_t inode = 0;
  off_t size = 0;
  std::int64_t changed_ns = 0;

  bool operator==(const Build& other) const {
    return device == other.device && inode == other.inode && size == other.size &&
           changed_ns == other.changed_ns;
  }
};

Build buildOf(const std::string& file) {
  struct stat info {};
  if (stat(file.c_str(), &info) != 0) return {};
  return {info.st_dev, info.st_ino, info.st_size,
          info.st_mtim.tv_sec * 1'000'000'000LL + info.st_mtim.tv_nsec};
}

// A library that is in memory. The dynamic linker may keep one there after it was closed (unique
// symbols, thread-local objects, -z nodelete): its static objects do not run again, so its makers
// are remembered here.
struct InMemory {
  std::weak_ptr<PluginLibrary> open;
  Build build;
  std::map<std::string, FeedbackControllerMaker> makers;
};

std::map<std::string, InMemory>& librariesInMemory() {
  static std::map<std::string, InMemory> libraries;
  return libraries;
}

bool isMapped(const std::string& file) {
  void* const still = dlopen(file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (still) dlclose(still);
  return still != nullptr;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::vector<std::string> foldersOf(const char* variable) {
  std::vector<std::string> folders;
  const char* value = std::getenv(variable);
  std::istringstream list(value ? value : "");
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.push_back(folder);
  }
  return folders;
}

std::string coreFolder() {
  Dl_info info;
  if (dladdr(reinterpret_cast<void*>(&prototypes), &info) == 0 || !info.dli_fname) return "";
  return fs::path(info.dli_fname).parent_path().string();
}

}  // namespace

struct PluginLibrary::Handle {
  ~Handle() {
    loader.reset();
    if (bound) dlclose(bound);
  }
  // Opened with all functions resolved: class_loader resolves late, and a function that nobody has
  // would end the process when it is called.
  void* bound = nullptr;
  std::unique_ptr<class_loader::ClassLoader> loader;
};

std::shared_ptr<PluginLibrary> PluginLibrary::open(const std::string& path) {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  std::error_code no_error;
  if (!fs::is_regular_file(path, no_error)) {
    throw std::runtime_error("there is no library " + path);
  }
  const std::string file = fs::canonical(path, no_error).string();
  const Build build = buildOf(file);
  InMemory& memory = librariesInMemory()[file];
  if (const auto open_already = memory.open.lock()) {
    if (memory.build == build) return open_already;
    throw std::runtime_error("library " + file + " was built again, and controllers of the old " +
                             "build are loaded; unload each of them first");
  }

  FeedbackControllerPrototypes& known = prototypes();
  const std::vector<std::string> before = known.types();
  known.takeRefused();
  std::shared_ptr<PluginLibrary> library(new PluginLibrary());
  library->path_ = file;
  library->handle_ = std::make_unique<Handle>();
  library->handle_->bound = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library->handle_->bound) {
    throw std::runtime_error("library " + file + " cannot be loaded: " + dlerror());
  }
  try {
    library->handle_->loader = std::make_unique<class_loader::ClassLoader>(file, false);
  } catch (const std::exception& e) {
    throw std::runtime_error("library " + file + " cannot be loaded: " + e.what());
  }
  const std::vector<std::string> after = known.types();
  std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                      std::back_inserter(library->types_));
  if (library->types_.empty() && !memory.makers.empty()) {
    if (!(memory.build == build)) {
      throw std::runtime_error(
          "library " + file + " was built again, but the dynamic linker keeps the old build in " +
          "memory; start the program again, or build the library so that it can be closed " +
          "(-fno-gnu-unique, no thread_local objects with destructors, no -z nodelete)");
    }
    for (const auto& entry : memory.makers) {
      if (known.insert(entry)) library->types_.push_back(entry.first);
    }
  } else {
    memory.makers.clear();
    for (const std::string& type : library->types_) memory.makers[type] = known.find(type);
    memory.build = build;
  }
  const std::vector<std::string> refused = known.takeRefused();
  if (!refused.empty()) {
    throw std::runtime_error("library " + file + " " + joined(refused));
  }
  if (library->types_.empty()) {
    throw std::runtime_error("library " + file +
                             " registers no controller; its source needs " +
                             "CTRL_MORE_REGISTER_CONTROLLER");
  }
  memory.open = library;
  return library;
}

PluginLibrary::~PluginLibrary() {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  if (!handle_) return;
  const auto memory = librariesInMemory().find(path_);
  // Makers written as in the paper do not take themselves out, nor do those of a library that
  // stays in memory.
  for (const std::string& type : types_) {
    const auto maker = memory->second.makers.find(type);
    if (maker != memory->second.makers.end()) prototypes().erase(type, maker->second);
  }
  handle_.reset();
  if (!isMapped(path_)) librariesInMemory().erase(memory);
}

ControllerInstance makeController(const std::string& library_path, const std::string& type) {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  ControllerInstance instance;
  std::string wanted = type;
  std::vector<std::string> known = prototypes().types();
  if (!library_path.empty()) {
    instance.library = PluginLibrary::open(library_path);
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
  // What the library throws lives in it, and may not leave this function.
  std::string described;
  const std::string threw = "the controller of type '" + wanted + "' threw while it was made: ";
  try {
    instance.controller.reset(prototypes().find(wanted)());
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
    throw std::runtime_error("the controller registered as '" + wanted +
                             "' describes itself as '" + described + "'; make them the same");
  }
  return instance;
}

SearchPath::SearchPath(std::string base, std::vector<std::string> extra)
    : base_(std::move(base)), extra_(std::move(extra)) {}

std::vector<std::string> SearchPath::candidates(const std::string& name) const {
  if (!name.empty() && name.front() == '/') return {name};
  std::vector<std::string> list;
  const std::string scheme = "package://";
  if (name.compare(0, scheme.size(), scheme) == 0) {
    const std::string rest = name.substr(scheme.size());
    const std::size_t slash = rest.find('/');
    const std::string package = rest.substr(0, slash);
    const std::string inside = slash == std::string::npos ? "" : rest.substr(slash + 1);
    for (const std::string& root : foldersOf("ROS_PACKAGE_PATH")) {
      list.push_back(root + "/" + package + "/" + inside);
      if (fs::path(root).filename() == package) list.push_back(root + "/" + inside);
    }
    for (const std::string& root : foldersOf("CMAKE_PREFIX_PATH")) {
      list.push_back(root + "/share/" + package + "/" + inside);
    }
    return list;
  }
  list.push_back((fs::path(base_) / name).string());
  for (const std::string& folder : extra_) {
    list.push_back((fs::path(base_) / folder / name).string());
  }
  for (const std::string& folder : foldersOf("CTRL_MORE_PATH")) list.push_back(folder + "/" + name);
  const std::string core = coreFolder();
  list.push_back(core + "/" + name);
  list.push_back(core + "/../share/ctrl_more/config/" + name);
  for (const std::string& root : foldersOf("CMAKE_PREFIX_PATH")) {
    list.push_back(root + "/lib/" + name);
    list.push_back(root + "/share/ctrl_more/config/" + name);
  }
  return list;
}

std::string SearchPath::find(const std::string& name) const {
  const std::vector<std::string> tried = candidates(name);
  std::error_code no_error;
  for (const std::string& file : tried) {
    if (fs::is_regular_file(file, no_error)) return file;
  }
  throw std::runtime_error("there is no file '" + name + "'; tried " +
                           (tried.empty() ? "nothing: no package path is set" : joined(tried)));
}

std::string SearchPath::findLibraryOf(const std::string& type) const {
  std::string snake;
  for (std::size_t i = 0; i < type.size(); ++i) {
    const unsigned char c = static_cast<unsigned char>(type[i]);
    const bool starts_word =
        std::isupper(c) && i > 0 && std::islower(static_cast<unsigned char>(type[i - 1]));
    if (starts_word) snake += '_';
    snake += static_cast<char>(std::tolower(c));
  }
  std::error_code no_error;
  for (const std::string& name : {"lib" + type + ".so", "libfbkCtrl" + type + ".so",
                                  "lib" + snake + ".so", "libctrl_more_" + snake + ".so"}) {
    for (const std::string& file : candidates(name)) {
      if (fs::is_regular_file(file, no_error)) return file;
    }
  }
  throw std::runtime_error("no libPath is given and no library of type '" + type +
                           "' was found (lib" + type + ".so, libfbkCtrl" + type + ".so, lib" +
                           snake + ".so, libctrl_more_" + snake +
                           ".so); give libPath, searchPath or CTRL_MORE_PATH");
}

}  // namespace ctrl_more
