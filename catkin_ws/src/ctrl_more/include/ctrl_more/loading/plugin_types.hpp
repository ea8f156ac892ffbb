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

/// What a plug-in library and the program that loads it must have in common. The compiler fills it
/// in on both sides; a library whose numbers differ would read and write in the wrong places, and
/// is refused.
struct Abi {
  int interface = 0;     ///< version of the headers: raised when classes or meanings change
  int compiler_abi = 0;  ///< `__GXX_ABI_VERSION`
  int eigen = 0;         ///< Eigen's version, 10000 world + 100 major + minor
  int eigen_align = 0;   ///< alignment that Eigen assumes [bytes]; depends on `-march`
  std::array<std::size_t, 16> sizes{};  ///< of the classes that both sides share [bytes]

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

  /// The clause about a library with these numbers, to which the program is a stranger.
  /// @param package whose headers it was compiled with
  /// @param program the numbers of the program that loads it
  std::string otherThan(const std::string& package, const Abi& program) const {
    return "compiled for another " + package + " (" + text() + "; this program has " +
           program.text() + "): build it again with the headers and the compiler of this program";
  }
};

/// The numbers of the file that is being compiled. Static, so that a library keeps its own.
/// @tparam Shared the classes that libraries and the program share
/// @param interface version of the headers
template <typename... Shared>
static constexpr Abi abiOf(int interface) {
  return {interface,
          __GXX_ABI_VERSION,
          10000 * EIGEN_WORLD_VERSION + 100 * EIGEN_MAJOR_VERSION + EIGEN_MINOR_VERSION,
          EIGEN_MAX_ALIGN_BYTES,
          {sizeof(Shared)...}};
}

/// The types of one kind of plug-in (feedback controllers, motion controllers), as the loader sees
/// them: libraries put their types in when they are loaded. A name that is known already is
/// refused, and so is a library compiled for other headers; refusals are remembered, so that the
/// whole library can be refused.
///
/// Any thread.
class PluginTypes {
 public:
  /// What a library did wrong.
  struct Refusal {
    std::string type;    ///< the name it registers
    std::string clause;  ///< what is wrong, for a sentence that begins with the library
  };

  /// @param kind what the types are, for messages: "controller"
  /// @param macro what registers one in a source file
  /// @param package whose headers libraries are compiled with
  /// @param abi what the program was compiled with
  PluginTypes(std::string kind, std::string macro, std::string package, const Abi& abi)
      : kind_(std::move(kind)), macro_(std::move(macro)), package_(std::move(package)), abi_(abi) {}
  virtual ~PluginTypes() = default;
  PluginTypes(const PluginTypes&) = delete;
  PluginTypes& operator=(const PluginTypes&) = delete;

  /// What the types are.
  const std::string& kind() const { return kind_; }
  /// What registers one in a source file.
  const std::string& macro() const { return macro_; }
  /// All known names, sorted.
  virtual std::vector<std::string> types() const = 0;
  /// What was refused since the last call; the list is emptied.
  std::vector<Refusal> takeRefused();

  /// @name For the loader
  /// @{

  /// The library of these types is closed: they are unknown from now on. Their makers are kept,
  /// because the dynamic linker may keep the library in memory, where it never registers again.
  virtual void setAside(const std::vector<std::string>& types) = 0;
  /// The library of these types was in memory all the time, and is opened again. What cannot come
  /// back is refused.
  /// @return those that are known again
  virtual std::vector<std::string> bringBack(const std::vector<std::string>& types) = 0;
  /// The library of these types has left the memory: their makers are no longer kept.
  virtual void forget(const std::vector<std::string>& types) = 0;
  /// @}

 protected:
  /// Says why a type cannot be taken, or nothing if it can; under the mutex.
  bool admit(const std::string& type, bool known, bool has_maker, const Abi& abi);
  /// Remembers a refusal; under the mutex.
  void refuse(const std::string& type, const std::string& clause);
  /// The clause about a name that is known already.
  static const char* knownAlready() {
    return ", which is registered already; give its controller another name";
  }

  mutable std::mutex mutex_;  ///< of everything here and below

 private:
  std::string kind_, macro_, package_;
  Abi abi_;
  std::vector<Refusal> refused_;
};

/// The same with what makes an object of each type.
/// @tparam Maker a value: `Maker{}` is an empty one; compared with ==
template <typename Maker>
class PluginTypesOf : public PluginTypes {
 public:
  using PluginTypes::PluginTypes;

  /// Removes a type, if its maker is this one.
  void erase(const std::string& type, const Maker& maker) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = makers_.find(type);
    if (found != makers_.end() && found->second == maker) makers_.erase(found);
  }

  /// Maker of a type, an empty one if it is unknown.
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
      aside_.insert(makers_.extract(type));  // nothing that could fail: a destructor calls this
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
  /// Takes a type, or remembers why not.
  /// @param type its name
  /// @param maker makes one
  /// @param abi what the library was compiled with
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
