#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace ctrl_more {

/// Binary interface (ABI) that a plug-in library and the program must share. The compiler fills in
/// the numbers on both sides. A library with other numbers would read and write at wrong addresses,
/// so it is refused.
struct Abi {
  int interface = 0;     ///< version of the headers: increased when classes or meanings change
  int compiler_abi = 0;  ///< `__GXX_ABI_VERSION`
  int eigen = 0;         ///< Eigen's version, 10000 world + 100 major + minor
  int eigen_align = 0;   ///< alignment that Eigen assumes [bytes]; depends on `-march`
  std::array<std::size_t, 16> sizes{};  ///< sizes of the shared classes [bytes]

  /// True if every number is the same.
  bool operator==(const Abi& other) const {
    return interface == other.interface && compiler_abi == other.compiler_abi &&
           eigen == other.eigen && eigen_align == other.eigen_align && sizes == other.sizes;
  }

  /// All numbers, for messages.
  std::string text() const {
    std::string all = "interface " + std::to_string(interface) + ", compiler ABI " +
                      std::to_string(compiler_abi) + ", Eigen " + std::to_string(eigen) +
                      " aligned to " + std::to_string(eigen_align) + ", sizes";
    for (const std::size_t size : sizes) {
      if (size != 0) all += " " + std::to_string(size);
    }
    return all;
  }

  /// Part of the error message for a library whose ABI differs from the program's.
  /// @param package package of the headers
  /// @param program ABI of the program that loads the library
  std::string otherThan(const std::string& package, const Abi& program) const {
    return "compiled for another " + package + " (" + text() + "; this program has " +
           program.text() + "): build it again with the headers and the compiler of this program";
  }
};

/// ABI of the file that is being compiled. Static, so that each library has its own copy.
/// @tparam Shared classes that libraries and the program share
/// @param interface version of the headers
template <typename... Shared>
static constexpr Abi abiOf(int interface) {
  return {interface,
          __GXX_ABI_VERSION,
          10000 * EIGEN_WORLD_VERSION + 100 * EIGEN_MAJOR_VERSION + EIGEN_MINOR_VERSION,
          EIGEN_MAX_ALIGN_BYTES,
          {sizeof(Shared)...}};
}

/// Registered types of one kind of plug-in (feedback controllers, motion controllers), as seen by
/// the loader. A library registers its types when it is loaded. A known name, or a library that was
/// compiled for other headers, is refused. Refusals are stored, so that the loader can refuse the
/// whole library.
///
/// Any thread.
class PluginTypes {
 public:
  /// Reason for which a type of a library was refused.
  struct Refusal {
    std::string type;    ///< name of the type
    std::string clause;  ///< the error; follows the library's name in the message
  };

  /// @param kind kind of the types for messages, such as "controller"
  /// @param macro macro that registers a type
  /// @param package package of the headers for libraries
  /// @param abi ABI of the program
  PluginTypes(std::string kind, std::string macro, std::string package, const Abi& abi);
  virtual ~PluginTypes();
  PluginTypes(const PluginTypes&) = delete;
  PluginTypes& operator=(const PluginTypes&) = delete;

  /// Kind of the types.
  const std::string& kind() const { return kind_; }
  /// Macro that registers a type.
  const std::string& macro() const { return macro_; }
  /// All known names, sorted.
  virtual std::vector<std::string> types() const = 0;
  /// Returns the refusals since the last call and clears the list.
  std::vector<Refusal> takeRefused();

  /// @name For the loader
  /// @{

  /// The library of these types was closed. The types are unknown from now on. Their makers are
  /// kept: if the dynamic linker keeps the library in memory, it does not register them again.
  virtual void setAside(const std::vector<std::string>& types) = 0;
  /// The library of these types stayed in memory and is opened again. Types that cannot be restored
  /// are refused.
  /// @return the restored types
  virtual std::vector<std::string> bringBack(const std::vector<std::string>& types) = 0;
  /// The library of these types was removed from memory. Discards their makers.
  virtual void forget(const std::vector<std::string>& types) = 0;
  /// Makes an object of a type and destroys it again. Exceptions of its code pass through. Does
  /// nothing for a kind whose objects need more than their maker.
  virtual void tryOne(const std::string& type) const = 0;
  /// The lists of all kinds in this process.
  static std::vector<const PluginTypes*> all();
  /// @}

 protected:
  /// Returns true if a type can be added; else stores the refusal. Needs the mutex.
  bool admit(const std::string& type, bool known, bool has_maker, const Abi& abi);
  /// Stores a refusal. Needs the mutex.
  void refuse(const std::string& type, const std::string& clause);
  /// Part of the error message for a name that is already registered.
  static const char* knownAlready() {
    return ", which is registered already; give its controller another name";
  }

  mutable std::mutex mutex_;  ///< protects all members here and in derived classes

 private:
  std::string kind_, macro_, package_;
  Abi abi_;
  std::vector<Refusal> refused_;
};

/// PluginTypes with a maker for each type.
/// @tparam Maker value type with ==; `Maker{}` is empty
template <typename Maker>
class PluginTypesOf : public PluginTypes {
 public:
  using PluginTypes::PluginTypes;

  /// Removes a type if it has this maker.
  void erase(const std::string& type, const Maker& maker) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = makers_.find(type);
    if (found != makers_.end() && found->second == maker) makers_.erase(found);
  }

  /// Maker of a type; empty if the type is unknown.
  Maker find(const std::string& type) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = makers_.find(type);
    return found == makers_.end() ? Maker{} : found->second;
  }

  /// All known names, sorted.
  std::vector<std::string> types() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<std::string> names;
    for (const auto& entry : makers_) names.push_back(entry.first);
    return names;
  }

  /// See PluginTypes.
  void setAside(const std::vector<std::string>& types) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const std::string& type : types) {
      aside_.erase(type);
      aside_.insert(makers_.extract(type));  // must not fail: a destructor calls this
    }
  }

  /// See PluginTypes.
  std::vector<std::string> bringBack(const std::vector<std::string>& types) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<std::string> back;
    for (const std::string& type : types) {
      const auto found = aside_.find(type);
      if (makers_.count(type) != 0) {
        refuse(type, knownAlready());
      } else if (found == aside_.end()) {
        refuse(type, ", was refused once and stayed in memory; start the program again");
      } else {
        makers_.insert(*found);
        back.push_back(type);
      }
    }
    return back;
  }

  /// See PluginTypes.
  void forget(const std::vector<std::string>& types) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const std::string& type : types) aside_.erase(type);
  }

 protected:
  /// Adds a type, or stores the refusal.
  /// @param type its name
  /// @param maker makes an object of the type
  /// @param abi ABI of the library
  bool add(const std::string& type, const Maker& maker, const Abi& abi) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return admit(type, makers_.count(type) != 0, !(maker == Maker{}), abi) &&
           makers_.emplace(type, maker).second;
  }

 private:
  std::map<std::string, Maker> makers_;
  std::map<std::string, Maker> aside_;  // of closed libraries
};

}  // namespace ctrl_more
