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

/// The table of signals behind RobotStates and ControlStates: names, sizes and units, and all
/// numbers in one contiguous buffer.
///
/// A key belongs to a group (a map or a container of the paper), and has one size for its whole
/// life. New keys are announced once on the logger; after freeze() a new key is an error. Values
/// that are not finite, and quaternions that are not unit (1e-6), are refused and leave the signal
/// untouched.
///
/// Threads: one thread at a time.
class SignalTable {
 public:
  /// One row.
  struct Entry {
    const SignalGroup* group;  ///< where it belongs
    SignalInfo info;           ///< the rest
    /// `group/key`.
    std::string name() const { return group->name + ("/" + info.key); }
  };

  /// An empty table.
  /// @param store name of the store for messages
  /// @param logger where new keys and wrong accesses are reported; null: Logger::standard()
  SignalTable(const char* store, Logger* logger);

  /// Adds a signal, or completes the unit and frame of one that exists with the same size.
  /// @param group where it belongs
  /// @param key name within the group, not empty
  /// @param size number of doubles, > 0
  /// @param unit SI unit or list of units
  /// @param frame frame the numbers are expressed in
  /// @param announce false: the logger is not told of a new key
  Status declare(const SignalGroup& group, const std::string& key, int size,
                 const std::string& unit, const std::string& frame, bool announce = true);

  /// Writes a signal; a new key is added.
  /// @param group where it belongs
  /// @param key name within the group
  /// @param value its numbers
  /// @param who name of the writer for messages
  Status set(const SignalGroup& group, const std::string& key,
             const Eigen::Ref<const Eigen::VectorXd>& value, const char* who);

  /// Reads a signal; on failure `value` is untouched.
  Status get(const SignalGroup& group, const std::string& key, Eigen::VectorXd& value,
             const char* who) const;

  /// Handle of a key; an empty one if there is none.
  Signal find(const SignalGroup& group, const std::string& key) const;

  /// Forbids new keys from now on.
  void freeze() { frozen_ = true; }
  /// True after freeze().
  bool frozen() const { return frozen_; }

  /// All rows, in order of declaration; Signal::index() is the place here.
  const std::vector<Entry>& entries() const { return entries_; }
  /// The rows of one group, in order of declaration.
  std::vector<SignalInfo> signals(const SignalGroup& group) const;
  /// All numbers; offsets as in Signal::offset().
  const std::vector<double>& data() const { return data_; }
  /// All numbers, writable.
  std::vector<double>& data() { return data_; }
  /// Key, size, unit and frame of a row, for people.
  static std::string label(const SignalInfo& info);
  /// The numbers of a row, each after a space.
  std::string numbers(const SignalInfo& info) const;

  /// Reports a refusal on the logger and returns it.
  Status refuse(const std::string& text) const;
  /// The sentence about a key that is not there.
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
