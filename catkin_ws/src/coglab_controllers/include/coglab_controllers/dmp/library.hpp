/// @file
/// Libraries of primitives as XML files (load_dmps, D4.10 Table 4). Not for the control cycle.
///
///     <dmp_library version="1">
///       <primitive id="reach_human" description="…">
///         <system duration="1.2" alpha="4.605" stiffness="150" damping="24.495"/>
///         <goal_weight kind="linear"/>       or kind="sigmoid" centre="0.5" steepness="10"
///         <shape mapping="similarity"/>      or "upright", "none"
///         <start position="0 0 0" velocity="0 0 0"/>
///         <goal position="0.5 0 0"/>
///         <basis centre="1" width="20.1" weight="0 0 0"/>   2 to kMaxBasis of them
///       </primitive>
///       <primitive id="wave">                            learnt while the file is loaded
///         <learn basis="20" alpha="4.605" stiffness="150"/>
///         <goal_weight kind="linear"/>
///         <shape mapping="none"/>
///         <trajectory> <sample t="0" position="0 0 0"/> … </trajectory>      one or several
///       </primitive>
///     </dmp_library>
#pragma once

#include <map>
#include <stdexcept>
#include <string>

#include "coglab_controllers/dmp/primitive.hpp"

namespace coglab_controllers {

/// Error in a library file; what() is "file:line: expected value, received value".
class LibraryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Primitives by id.
class Library {
 public:
  static constexpr std::size_t kMaxFileBytes = 4u << 20;  ///< larger files are refused unread
  static constexpr int kMaxPrimitives = 500;
  static constexpr int kMaxSamples = 20000;  ///< per trajectory

  /// Adds all primitives of a file, or none. An id that is already loaded is replaced.
  /// @return number of primitives in the file.
  /// @throws LibraryError if the file cannot be used.
  int load(const std::string& path);
  /// Loads primitives from text; error messages show `name` as the file.
  int parse(const std::string& text, const std::string& name);
  /// Writes all primitives as weights. Reading them gives bit-identical numbers. The write is
  /// atomic: no partial file remains.  @throws LibraryError if the file cannot be written.
  void save(const std::string& path) const;
  /// Returns the text that `save` writes.
  std::string format() const;

  /// Adds or replaces a primitive.  @throws std::invalid_argument if it is not valid.
  void add(const Primitive& primitive);
  /// Returns the primitive, or null if the id is unknown.
  const Primitive* find(const std::string& id) const noexcept;
  /// Returns the primitive. @throws std::invalid_argument if unknown; it lists the loaded ids.
  const Primitive& at(const std::string& id) const;
  const std::map<std::string, Primitive>& primitives() const noexcept { return primitives_; }

 private:
  std::map<std::string, Primitive> primitives_;
};

}  // namespace coglab_controllers
