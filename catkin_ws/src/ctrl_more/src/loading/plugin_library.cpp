#include "ctrl_more/loading/plugin_library.hpp"

#include <dlfcn.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <map>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "ctrl_more/log/words.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {
namespace {

// Serialises opening and closing.
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

bool isMapped(const std::string& file) {
  void* const still = dlopen(file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (still) dlclose(still);
  return still != nullptr;
}

}  // namespace

// A library that is in memory. The dynamic linker may keep one there after it was closed (unique
// symbols, thread-local objects, -z nodelete): its static objects do not run again, so what it
// registered once is remembered here.
struct PluginLibrary::InMemory {
  std::weak_ptr<PluginLibrary> open;
  Build build;
  std::vector<std::string> types;

  using Key = std::pair<std::string, const PluginTypes*>;
  static std::map<Key, InMemory>& all() {
    static std::map<Key, InMemory> libraries;
    return libraries;
  }
};

std::shared_ptr<PluginLibrary> PluginLibrary::open(const std::string& path, PluginTypes& types) {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  std::error_code no_error;
  if (!fs::is_regular_file(path, no_error)) {
    throw std::runtime_error("there is no library " + path +
                             "; check the path, and that its package is built");
  }
  const std::string file = fs::canonical(path, no_error).string();
  InMemory& memory = InMemory::all()[{file, &types}];
  if (const auto open_already = memory.open.lock()) {
    if (memory.build == buildOf(file)) return open_already;
    throw std::runtime_error("library " + file + " was built again, and controllers of the old " +
                             "build are loaded; unload each of them first");
  }
  std::shared_ptr<PluginLibrary> library(new PluginLibrary(file, types));
  library->load(memory);
  memory.open = library;
  return library;
}

// Opens the file, and sees what it registers.
void PluginLibrary::load(InMemory& memory) {
  const Build build = buildOf(path_);
  const std::vector<std::string> before = list_.types();
  list_.takeRefused();
  // All functions are resolved at once: one that nobody has would end the process when it is
  // called.
  handle_ = dlopen(path_.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!handle_) {
    throw std::runtime_error("library " + path_ + " cannot be loaded: " + dlerror());
  }
  const std::vector<std::string> after = list_.types();
  std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                      std::back_inserter(types_));
  std::vector<PluginTypes::Refusal> refused = list_.takeRefused();
  if (types_.empty() && refused.empty() && !memory.types.empty()) {
    if (!(memory.build == build)) {
      throw std::runtime_error(
          "library " + path_ + " was built again, but the dynamic linker keeps the old build in " +
          "memory; start the program again, or build the library so that it can be closed " +
          "(-fno-gnu-unique, no thread_local objects with destructors, no -z nodelete)");
    }
    types_ = list_.bringBack(memory.types);
    refused = list_.takeRefused();
  } else {
    memory.types = types_;
    for (const PluginTypes::Refusal& refusal : refused) memory.types.push_back(refusal.type);
    memory.build = build;
  }
  if (!refused.empty()) {
    std::vector<std::string> clauses;
    for (const PluginTypes::Refusal& refusal : refused) clauses.push_back(refusal.clause);
    throw std::runtime_error("library " + path_ + " " + joined(clauses));
  }
  if (types_.empty()) {
    throw std::runtime_error("library " + path_ + " registers no " + list_.kind() +
                             "; its source needs " + list_.macro());
  }
}

PluginLibrary::~PluginLibrary() {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  if (!handle_) return;
  // Makers written as in the paper do not take themselves out, nor do those of a library that
  // stays in memory.
  list_.setAside(types_);
  dlclose(handle_);
  if (isMapped(path_)) return;
  list_.forget(types_);
  auto& all = InMemory::all();
  for (auto it = all.begin(); it != all.end(); ++it) {
    if (it->first.first != path_ || it->first.second != &list_) continue;
    all.erase(it);
    break;
  }
}

}  // namespace ctrl_more
