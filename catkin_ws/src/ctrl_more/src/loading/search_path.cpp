#include "ctrl_more/loading/search_path.hpp"

#include <dlfcn.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "ctrl_more/log/words.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {
namespace {

std::vector<std::string> foldersOf(const char* variable) {
  std::vector<std::string> folders;
  const char* value = std::getenv(variable);
  std::istringstream list(value ? value : "");
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.push_back(folder);
  }
  return folders;
}

}  // namespace

std::string coreFolder() {
  Dl_info info;
  if (dladdr(reinterpret_cast<void*>(&coreFolder), &info) == 0 || !info.dli_fname) return "";
  return fs::path(info.dli_fname).parent_path().string();
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
  // Never relative to the current folder.
  if (!base_.empty()) list.push_back((fs::path(base_) / name).string());
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
  throw std::runtime_error("file '" + name + "' was not found; tried " +
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
