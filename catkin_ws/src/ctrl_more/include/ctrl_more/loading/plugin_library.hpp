#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ctrl_more/loading/plugin_types.hpp"

namespace ctrl_more {

/// One loaded plug-in library, the same for every kind of plug-in. Stays loaded while anything
/// holds it; objects made by it must be destroyed before.
///
/// A library that was built again is loaded anew once everything of the old build is gone; where
/// the dynamic linker keeps the old code, loading is refused and says so.
class PluginLibrary {
 public:
  /// Loads a library, or returns the one that is loaded already.
  /// @param path file
  /// @param types where the library registers its types
  /// @throws std::runtime_error with a sentence: file missing or not loadable, no type in it,
  ///         compiled for other headers, a type name that is registered already
  static std::shared_ptr<PluginLibrary> open(const std::string& path, PluginTypes& types);

  ~PluginLibrary();
  PluginLibrary(const PluginLibrary&) = delete;
  PluginLibrary& operator=(const PluginLibrary&) = delete;

  /// File the library came from.
  const std::string& path() const { return path_; }

  /// Types it registers, sorted.
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
  void* handle_ = nullptr;  // of the dynamic linker
};

}  // namespace ctrl_more
