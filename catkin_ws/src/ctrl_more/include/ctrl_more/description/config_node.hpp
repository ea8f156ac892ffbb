#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace ctrl_more {

/// A configuration that cannot be used. The text is one sentence that starts with `file:line:`.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A parsed YAML file as a tree that knows its lines (Ctrl-MORE paper, section III-A).
///
/// Files are bounded before they are trusted: 1 MB, depth 32, 20000 nodes with aliases counted
/// each time they are used; duplicate keys are refused.
class ConfigNode {
 public:
  /// What a node is.
  enum class Kind { Empty, Scalar, List, Map };

  /// Parses a file; throws ConfigError.
  /// @param path file to read
  static ConfigNode fromFile(const std::string& path);

  /// Parses a text; throws ConfigError.
  /// @param text YAML
  /// @param name what to call it in messages, for example a file name
  static ConfigNode fromText(const std::string& text, const std::string& name);

  /// What the node is.
  Kind kind() const { return kind_; }
  /// Line in the file, from 1.
  int line() const { return line_; }
  /// `file:line`.
  std::string place() const;

  /// Text of a scalar; throws ConfigError naming `what` if it is not one.
  const std::string& text(const std::string& what) const;
  /// Finite number of a scalar; throws ConfigError naming `what`.
  double number(const std::string& what) const;
  /// `true` or `false`; throws ConfigError naming `what`.
  bool boolean(const std::string& what) const;
  /// Finite numbers of a list, or of one scalar; throws ConfigError naming `what`.
  std::vector<double> numbers(const std::string& what) const;
  /// Texts of a list; throws ConfigError naming `what`.
  std::vector<std::string> texts(const std::string& what) const;

  /// Elements of a list.
  const std::vector<ConfigNode>& items() const { return items_; }
  /// Entries of a map, in the order of the file.
  const std::vector<std::pair<std::string, ConfigNode>>& entries() const { return entries_; }
  /// Entry of a map, null if there is none.
  const ConfigNode* find(const std::string& key) const;
  /// Keys of a map, in the order of the file.
  std::vector<std::string> keys() const;
  /// Throws ConfigError if the node is not a map or has a key that is not known, with the nearest
  /// known one.
  void requireKeys(const std::string& what, const std::vector<std::string>& known) const;

  /// A ConfigError at this node.
  ConfigError error(const std::string& text) const;

 private:
  friend class ConfigReader;
  Kind kind_ = Kind::Empty;
  int line_ = 0;
  std::string file_;
  std::string scalar_;
  std::vector<ConfigNode> items_;
  std::vector<std::pair<std::string, ConfigNode>> entries_;
};

}  // namespace ctrl_more
