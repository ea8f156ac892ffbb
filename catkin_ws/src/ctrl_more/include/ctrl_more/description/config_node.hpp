#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace ctrl_more {

/// Thrown for an invalid configuration. The text is one sentence that starts with `file:line:`.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A parsed YAML file as a tree. Each node stores its line (Ctrl-MORE paper, section III-A).
///
/// Limits of a file: 1 MB, depth 32, 20000 nodes. Each use of an alias counts. Duplicate keys are
/// refused.
class ConfigNode {
 public:
  /// Kind of a node.
  enum class Kind { Empty, Scalar, List, Map };

  /// Parses a file; throws ConfigError.
  /// @param path file to read
  static ConfigNode fromFile(const std::string& path);

  /// Parses a text; throws ConfigError.
  /// @param text YAML
  /// @param name name for messages, for example a file name
  static ConfigNode fromText(const std::string& text, const std::string& name);

  /// Kind of the node.
  Kind kind() const { return kind_; }
  /// Line in the file, starting at 1.
  int line() const { return line_; }
  /// `file:line`.
  std::string place() const;

  /// Text of a scalar. Throws ConfigError with `what` if the node is no scalar.
  const std::string& text(const std::string& what) const;
  /// Finite number of a scalar. Throws ConfigError with `what`.
  double number(const std::string& what) const;
  /// `true` or `false`. Throws ConfigError with `what`.
  bool boolean(const std::string& what) const;
  /// Finite numbers of a list, or of one scalar. Throws ConfigError with `what`.
  std::vector<double> numbers(const std::string& what) const;
  /// Texts of a list. Throws ConfigError with `what`.
  std::vector<std::string> texts(const std::string& what) const;

  /// Elements of a list.
  const std::vector<ConfigNode>& items() const { return items_; }
  /// Entries of a map, in the order of the file.
  const std::vector<std::pair<std::string, ConfigNode>>& entries() const { return entries_; }
  /// Entry of a map; null if the key is missing.
  const ConfigNode* find(const std::string& key) const;
  /// Keys of a map, in the order of the file.
  std::vector<std::string> keys() const;
  /// Throws ConfigError if the node is not a map or has an unknown key. The text suggests the
  /// nearest known key.
  void requireKeys(const std::string& what, const std::vector<std::string>& known) const;

  /// Returns a ConfigError with the place of this node.
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
