#include "ctrl_more/description/config_node.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <sstream>

#include <yaml-cpp/yaml.h>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

constexpr std::size_t kMaxBytes = 1 << 20;
constexpr int kMaxDepth = 32;
constexpr int kMaxNodes = 20000;

// Makes untrusted text printable and short, for messages.
std::string shown(const std::string& text) {
  std::string result;
  for (const char c : text.substr(0, 60)) {
    result += std::isprint(static_cast<unsigned char>(c)) ? c : '?';
  }
  return text.size() > 60 ? result + "..." : result;
}

}  // namespace

/// Converts nodes of yaml-cpp to ConfigNode and checks the limits.
class ConfigReader {
 public:
  explicit ConfigReader(std::string file) : file_(std::move(file)) {}

  ConfigNode read(const YAML::Node& node, int depth = 0) {
    ConfigNode result;
    result.file_ = file_;
    result.line_ = node.Mark().line + 1;
    if (++nodes_ > kMaxNodes) throw result.error("more than 20000 nodes (aliases counted)");
    if (depth > kMaxDepth) throw result.error("nested deeper than 32 levels");
    if (node.IsScalar()) {
      result.kind_ = ConfigNode::Kind::Scalar;
      result.scalar_ = node.Scalar();
    } else if (node.IsSequence()) {
      result.kind_ = ConfigNode::Kind::List;
      for (const auto& item : node) result.items_.push_back(read(item, depth + 1));
    } else if (node.IsMap()) {
      result.kind_ = ConfigNode::Kind::Map;
      for (const auto& entry : node) {
        if (!entry.first.IsScalar()) throw result.error("a key must be a plain text");
        const std::string key = entry.first.Scalar();
        ConfigNode value = read(entry.second, depth + 1);
        value.line_ = entry.first.Mark().line + 1;
        if (result.find(key)) throw value.error("key '" + shown(key) + "' appears twice");
        result.entries_.emplace_back(key, std::move(value));
      }
    }
    return result;
  }

 private:
  std::string file_;
  int nodes_ = 0;
};

ConfigNode ConfigNode::fromText(const std::string& text, const std::string& name) {
  if (text.size() > kMaxBytes) {
    throw ConfigError(name + ":1: larger than 1 MB; this is no configuration file");
  }
  try {
    return ConfigReader(name).read(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    throw ConfigError(name + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
}

ConfigNode ConfigNode::fromFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw ConfigError(path + ":1: cannot be opened; check path and permissions");
  std::string text(kMaxBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) throw ConfigError(path + ":1: cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return fromText(text, path);
}

std::string ConfigNode::place() const { return file_ + ":" + std::to_string(line_); }

ConfigError ConfigNode::error(const std::string& text) const {
  return ConfigError(place() + ": " + text);
}

const std::string& ConfigNode::text(const std::string& what) const {
  if (kind_ != Kind::Scalar) throw error(what + " expects a text");
  return scalar_;
}

double ConfigNode::number(const std::string& what) const {
  if (kind_ == Kind::Scalar) {
    std::istringstream stream(scalar_);
    stream.imbue(std::locale::classic());
    double value = 0.0;
    if (stream >> value && stream.eof() && std::isfinite(value)) return value;
  }
  throw error(what + " expects a number, got '" +
              (kind_ == Kind::Scalar ? shown(scalar_) : "something else") + "'");
}

bool ConfigNode::boolean(const std::string& what) const {
  if (kind_ == Kind::Scalar && scalar_ == "true") return true;
  if (kind_ == Kind::Scalar && scalar_ == "false") return false;
  throw error(what + " expects true or false");
}

std::vector<double> ConfigNode::numbers(const std::string& what) const {
  if (kind_ == Kind::Scalar) return {number(what)};
  if (kind_ != Kind::List) throw error(what + " expects numbers");
  std::vector<double> values;
  for (const ConfigNode& item : items_) values.push_back(item.number(what));
  return values;
}

std::vector<std::string> ConfigNode::texts(const std::string& what) const {
  if (kind_ != Kind::List) throw error(what + " expects a list of names");
  std::vector<std::string> values;
  for (const ConfigNode& item : items_) values.push_back(item.text(what));
  return values;
}

const ConfigNode* ConfigNode::find(const std::string& key) const {
  for (const auto& entry : entries_) {
    if (entry.first == key) return &entry.second;
  }
  return nullptr;
}

std::vector<std::string> ConfigNode::keys() const {
  std::vector<std::string> list;
  for (const auto& entry : entries_) list.push_back(entry.first);
  return list;
}

void ConfigNode::requireKeys(const std::string& what, const std::vector<std::string>& known) const {
  if (kind_ != Kind::Map) throw error(what + " expects a map");
  for (const auto& entry : entries_) {
    if (std::find(known.begin(), known.end(), entry.first) == known.end()) {
      throw entry.second.error(what + " has an unknown key '" + shown(entry.first) + "'" +
                               suggestion(entry.first, known));
    }
  }
}

}  // namespace ctrl_more
