#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "ctrl_more/states/signal.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

class Logger;

/// Table of signals in RobotStates and ControlStates: names, sizes and units, and all numbers in
/// one contiguous buffer.
///
/// A key belongs to a group (a map or a container of the paper). Its size never changes. A new key
/// is logged once; after freeze() it is an error. Values that are not finite and quaternions that
/// are not unit (1e-6) are refused and leave the signal unchanged.
///
/// Threads: one thread at a time.
class SignalTable {
 public:
  /// One row.
  struct Entry {
    const SignalGroup* group;  ///< group of the signal
    SignalInfo info;           ///< its other properties
    /// `group/key`.
    std::string name() const { return group->name + ("/" + info.key); }
  };

  /// An empty table.
  /// @param store name of the store for messages
  /// @param logger logs new keys and wrong accesses; null: Logger::standard()
  SignalTable(const char* store, Logger* logger);

  /// Adds a signal, or adds unit and frame to an existing signal of the same size.
  /// @param group group of the signal
  /// @param key name within the group, not empty
  /// @param size number of doubles, > 0
  /// @param unit SI unit or list of units
  /// @param frame frame of the numbers
  /// @param announce false: do not log a new key
  Status declare(const SignalGroup& group, const std::string& key, int size,
                 const std::string& unit, const std::string& frame, bool announce = true);

  /// Writes a signal. A new key is added.
  /// @param group group of the signal
  /// @param key name within the group
  /// @param value its numbers
  /// @param who name of the writer for messages
  Status set(const SignalGroup& group, const std::string& key,
             const Eigen::Ref<const Eigen::VectorXd>& value, const char* who);

  /// Reads a signal. On failure `value` is unchanged.
  Status get(const SignalGroup& group, const std::string& key, Eigen::VectorXd& value,
             const char* who) const;

  /// Handle of a key; empty if the key does not exist.
  Signal find(const SignalGroup& group, const std::string& key) const;

  /// Forbids new keys from now on.
  void freeze() { frozen_ = true; }
  /// True after freeze().
  bool frozen() const { return frozen_; }

  /// All rows, in order of declaration. Signal::index() is the index of a row.
  const std::vector<Entry>& entries() const { return entries_; }
  /// The rows of one group, in order of declaration.
  std::vector<SignalInfo> signals(const SignalGroup& group) const;
  /// All numbers; offsets as in Signal::offset().
  const std::vector<double>& data() const { return data_; }
  /// All numbers, writable.
  std::vector<double>& data() { return data_; }
  /// Key, size, unit and frame of a row as text.
  static std::string label(const SignalInfo& info);
  /// The numbers of a row, each after a space.
  std::string numbers(const SignalInfo& info) const;

  /// Logs a refusal and returns it.
  Status refuse(const std::string& text) const;
  /// Error message for a key that does not exist.
  std::string unknownKey(const SignalGroup& group, const std::string& key, const char* who) const;

 private:
  Status add(const SignalGroup& group, const std::string& key, int size, const std::string& unit,
             const std::string& frame, const char* who, bool announce);

  const char* store_;
  Logger* logger_;
  bool frozen_ = false;
  std::unordered_map<std::string, std::uint32_t> index_;  // by group/key
  std::vector<Entry> entries_;
  std::vector<double> data_;
};

}  // namespace ctrl_more
