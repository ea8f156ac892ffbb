#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ctrl_more/loading/plugin_types.hpp"

namespace ctrl_more {

/// One loaded plug-in library, for every kind of plug-in. It stays loaded while a pointer to it
/// exists. Objects that it made must be destroyed before it.
///
/// A library that was rebuilt is loaded again after all objects and pointers of the old build are
/// gone. If the dynamic linker keeps the old code in memory, loading is refused with that reason.
class PluginLibrary {
 public:
  /// Loads a library, or returns the one that is already loaded.
  /// @param path file
  /// @param types list in which the library registers its types
  /// @throws std::runtime_error with one sentence if the file is missing or cannot be loaded,
  ///         registers no type or a known type name, or was compiled for other headers
  static std::shared_ptr<PluginLibrary> open(const std::string& path, PluginTypes& types);

  ~PluginLibrary();
  PluginLibrary(const PluginLibrary&) = delete;
  PluginLibrary& operator=(const PluginLibrary&) = delete;

  /// File of the library.
  const std::string& path() const { return path_; }

  /// Registered types, sorted.
  const std::vector<std::string>& types() const { return types_; }

 private:
  struct InMemory;

  PluginLibrary(std::string path, PluginTypes& list) : path_(std::move(path)), list_(list) {}
  void mapCopy(InMemory& memory, const std::string& copy);
  void mapAgain(const InMemory& memory);
  void expectTypes(const std::vector<PluginTypes::Refusal>& refused) const;
  void map(const std::string& file);

  std::string path_, mapped_;  // the user's file, and the copy of it that was opened
  PluginTypes& list_;
  std::vector<std::string> types_;
  void* handle_ = nullptr;  // handle of the dynamic linker
};

}  // namespace ctrl_more
