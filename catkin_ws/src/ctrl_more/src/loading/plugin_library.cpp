#include "ctrl_more/loading/plugin_library.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <map>
#include <mutex>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "ctrl_more/log/words.hpp"
#include "loading/library_file.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {

namespace {

struct AllTypes {
  std::mutex mutex;
  std::vector<const PluginTypes*> lists;
};

AllTypes& allTypes() {
  static AllTypes all;
  return all;
}

}  // namespace

PluginTypes::PluginTypes(std::string kind, std::string macro, std::string package, const Abi& abi)
    : kind_(std::move(kind)), macro_(std::move(macro)), package_(std::move(package)), abi_(abi) {
  AllTypes& all = allTypes();
  const std::lock_guard<std::mutex> lock(all.mutex);
  all.lists.push_back(this);
}

PluginTypes::~PluginTypes() {
  AllTypes& all = allTypes();
  const std::lock_guard<std::mutex> lock(all.mutex);
  all.lists.erase(std::find(all.lists.begin(), all.lists.end(), this));
}

std::vector<const PluginTypes*> PluginTypes::all() {
  AllTypes& all = allTypes();
  const std::lock_guard<std::mutex> lock(all.mutex);
  return all.lists;
}

std::vector<PluginTypes::Refusal> PluginTypes::takeRefused() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<Refusal> refused;
  refused.swap(refused_);
  return refused;
}

void PluginTypes::refuse(const std::string& type, const std::string& clause) {
  refused_.push_back({type, "registers '" + type + "'" + clause});
}

bool PluginTypes::admit(const std::string& type, bool known, bool has_maker, const Abi& abi) {
  if (!(abi == abi_)) {
    refuse(type, " " + abi.otherThan(package_, abi_));
  } else if (!has_maker) {
    refuse(type, " without a maker");
  } else if (known) {
    refuse(type, knownAlready());
  } else {
    return true;
  }
  return false;
}

namespace {

// Serialises opening and closing.
std::recursive_mutex& loaderMutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

// Identifies a build of a file: device, inode, size and time of change.
using Build = std::tuple<dev_t, ino_t, off_t, std::int64_t>;

Build buildOf(const std::string& file) {
  struct stat info {};
  if (stat(file.c_str(), &info) != 0) return {};
  return {info.st_dev, info.st_ino, info.st_size,
          info.st_mtim.tv_sec * 1'000'000'000LL + info.st_mtim.tv_nsec};
}

// If an exception leaves the linker, it keeps its lock and blocks all other threads. This is very
// unlikely, because each library is first tried in another process.
bool linker_locked = false;  // under the loader's mutex
const char* const kLinkerLocked =
    "No library can be opened or closed any more; start the program again";

bool isMapped(const std::string& file) {
  void* const still = file.empty() ? nullptr : dlopen(file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (still) dlclose(still);
  return still != nullptr;
}

}  // namespace

// A library in memory. The dynamic linker may keep it there after it was closed (unique symbols,
// thread-local objects, -z nodelete). Its static objects then do not run again, so its registered
// types are stored here.
struct PluginLibrary::InMemory {
  std::weak_ptr<PluginLibrary> open;
  Build build;
  std::string mapped;  // the copy that was opened
  std::vector<std::string> types;

  using Key = std::pair<std::string, const PluginTypes*>;
  static std::map<Key, InMemory>& all() {
    static std::map<Key, InMemory> libraries;
    return libraries;
  }
};

std::shared_ptr<PluginLibrary> PluginLibrary::open(const std::string& path, PluginTypes& types) {
  std::error_code no_error;
  if (!fs::is_regular_file(path, no_error)) {
    throw std::runtime_error("there is no library " + path +
                             "; check the path, and that its package is built");
  }
  const std::string file = fs::canonical(path, no_error).string();
  std::unique_ptr<LibraryCopy> copy;
  Build build;  // of the copy
  for (;;) {
    {
      const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
      if (linker_locked) throw std::runtime_error(kLinkerLocked);
      InMemory& memory = InMemory::all()[{file, &types}];
      if (const auto open_already = memory.open.lock()) {
        if (memory.build == buildOf(file)) return open_already;
        throw std::runtime_error("library " + file + " was built again, and controllers of the " +
                                 "old build are loaded; unload each of them first");
      }
      std::shared_ptr<PluginLibrary> library(new PluginLibrary(file, types));
      if (isMapped(memory.mapped)) {
        library->mapAgain(memory);
      } else if (copy) {
        memory.build = build;
        library->mapCopy(memory, copy->path());
      }
      if (library->handle_) {
        memory.open = library;
        return library;
      }
    }
    build = buildOf(file);
    copy = std::make_unique<LibraryCopy>(file);
    copy->check();  // without the lock: it may take seconds
  }
}

void PluginLibrary::mapCopy(InMemory& memory, const std::string& copy) {
  const std::vector<std::string> before = list_.types();
  list_.takeRefused();
  map(copy);
  const std::vector<std::string> after = list_.types();
  std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                      std::back_inserter(types_));
  const std::vector<PluginTypes::Refusal> refused = list_.takeRefused();
  memory.mapped = copy;
  memory.types = types_;
  for (const PluginTypes::Refusal& refusal : refused) memory.types.push_back(refusal.type);
  expectTypes(refused);
}

// Registers the types again, because static objects run only once.
void PluginLibrary::mapAgain(const InMemory& memory) {
  if (!(memory.build == buildOf(path_))) {
    throw std::runtime_error(
        "library " + path_ + " was built again, but the dynamic linker keeps the old build in " +
        "memory; start the program again, or build the library so that it can be closed " +
        "(-fno-gnu-unique, no thread_local objects with destructors, no -z nodelete)");
  }
  map(memory.mapped);
  types_ = list_.bringBack(memory.types);
  expectTypes(list_.takeRefused());
}

void PluginLibrary::expectTypes(const std::vector<PluginTypes::Refusal>& refused) const {
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

void PluginLibrary::map(const std::string& file) {
  mapped_ = file;
  try {
    handle_ = openLibrary(file.c_str());
  } catch (...) {
    linker_locked = true;
    throw std::runtime_error("library " + path_ + " threw while it was opened. " + kLinkerLocked);
  }
  if (!handle_) {
    throw std::runtime_error("library " + path_ + " cannot be loaded: " + dlerror());
  }
}

PluginLibrary::~PluginLibrary() {
  const std::lock_guard<std::recursive_mutex> lock(loaderMutex());
  if (!handle_ || linker_locked) return;
  // Makers written as in the paper do not unregister, nor do those of a library that stays in
  // memory.
  list_.setAside(types_);
  dlclose(handle_);
  if (isMapped(mapped_)) return;
  list_.forget(types_);
  auto& all = InMemory::all();
  for (auto it = all.begin(); it != all.end(); ++it) {
    if (it->first.first != path_ || it->first.second != &list_) continue;
    all.erase(it);
    break;
  }
}

}  // namespace ctrl_more
