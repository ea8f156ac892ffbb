/// @file
/// Libraries of primitives as XML files (load_dmps, D4.10 Table 4). Not for the control cycle.
///
///     <dmp_library version="1">
///       <primitive id="reach_human" description="…">
///         <system duration="1.2" alpha="4.605" stiffness="150" damping="24.495"/>
///         <goal_weight kind="linear"/>                   or kind="sigmoid" centre="0.5"
///         steepness="10" <shape mapping="similarity"/>                  or "upright", "none"
///         <start position="0 0 0" velocity="0 0 0"/>
///         <goal position="0.5 0 0"/>
///         <basis centre="1" width="20.1" weight="0 0 0"/>   2 to kMaxBasis of them
///       </primitive>
///       <primitive id="wave">                            learnt when the file is read
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

/// A library file that cannot be used; what() is "file:line: what was expected, what came".
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
  /// @return how many the file holds.
  /// @throws LibraryError if the file cannot be used.
  int load(const std::string& path);
  /// The same from text; `name` stands for the file in messages.
  int parse(const std::string& text, const std::string& name);
  /// Writes all primitives as weights, numbers so that reading gives the same bits. The file
  /// appears whole or not at all.  @throws LibraryError if it cannot be written.
  void save(const std::string& path) const;
  /// The text that `save` writes.
  std::string format() const;

  /// Adds or replaces one.  @throws std::invalid_argument if it is not valid.
  void add(const Primitive& primitive);
  /// Null if unknown.
  const Primitive* find(const std::string& id) const noexcept;
  /// @throws std::invalid_argument naming the ids that are loaded.
  const Primitive& at(const std::string& id) const;
  const std::map<std::string, Primitive>& primitives() const noexcept { return primitives_; }

 private:
  std::map<std::string, Primitive> primitives_;
};

}  // namespace coglab_controllers
