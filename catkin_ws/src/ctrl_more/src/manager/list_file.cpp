#include "manager/list_file.hpp"

#include <algorithm>
#include <stdexcept>

#include "ctrl_more/loading/script_loader.hpp"
#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

const std::vector<std::string> kFileKeys = {"loadControllers", "profiles", "searchPath",
                                            "sharedSignals", "signals"};
const std::vector<std::string> kBlockKeys = {"libPath",    "configFile", "type",   "enabled",
                                             "overrun_us", "on_fault",   "blend_s"};

StopPolicy readPolicy(const ConfigNode& node) {
  const std::string text = node.text("on_fault");
  if (text == "hold") return StopPolicy::Hold;
  if (text == "fade") return StopPolicy::Fade;
  if (text == "zero") return StopPolicy::Zero;
  throw node.error("on_fault cannot be '" + text + "'" +
                   suggestion(text, {"hold", "fade", "zero"}));
}

double readPositive(const ConfigNode& node, const std::string& what) {
  const double value = node.number(what);
  if (value < 0.0) throw node.error(what + " must not be negative");
  return value;
}

ControllerEntry readEntry(const std::string& name, const ConfigNode& block, const SearchPath& files,
                          const std::string& base) {
  block.requireKeys("controller '" + name + "'", kBlockKeys);
  ControllerEntry entry;
  const auto locate = [&](const ConfigNode& node, const char* key) {
    try {
      return files.find(node.text(key));
    } catch (const ConfigError&) {
      throw;
    } catch (const std::exception& e) {
      throw node.error(std::string(key) + " of '" + name + "': " + e.what());
    }
  };
  if (const ConfigNode* node = block.find("type")) entry.type = node->text("type");
  if (const ConfigNode* node = block.find("enabled")) entry.enabled = node->boolean("enabled");
  if (const ConfigNode* node = block.find("overrun_us")) {
    entry.overrun_us = readPositive(*node, "overrun_us");
  }
  if (const ConfigNode* node = block.find("blend_s")) {
    entry.blend_s = readPositive(*node, "blend_s");
  }
  if (const ConfigNode* node = block.find("on_fault")) entry.on_fault = readPolicy(*node);
  if (const ConfigNode* node = block.find("configFile")) {
    entry.config_file = locate(*node, "configFile");
  }
  if (isScriptType(entry.type)) {
    if (const ConfigNode* node = block.find("libPath")) {
      throw node->error("controller '" + name + "': type " + entry.type +
                        " is a Python class, which has no libPath; delete one of the two");
    }
    entry.library = base;
    return entry;
  }
  if (const ConfigNode* node = block.find("libPath")) entry.library = locate(*node, "libPath");
  if (entry.library.empty()) {
    const std::string type = entry.type.empty() ? name : entry.type;
    try {
      entry.library = files.findLibraryOf(type);
    } catch (const std::exception& e) {
      throw block.error("controller '" + name + "': " + e.what());
    }
    entry.type = type;
  }
  return entry;
}

// Names of the blocks of controllers in a list file.
std::vector<std::string> blocksOf(const ConfigNode& list) {
  std::vector<std::string> blocks;
  for (const auto& entry : list.entries()) {
    if (std::find(kFileKeys.begin(), kFileKeys.end(), entry.first) != kFileKeys.end()) continue;
    if (entry.second.kind() != ConfigNode::Kind::Map) {
      throw entry.second.error("'" + entry.first + "' is neither a block of a controller nor a " +
                               "known key" + suggestion(entry.first, kFileKeys));
    }
    blocks.push_back(entry.first);
  }
  return blocks;
}

}  // namespace

SearchPath ListFile::filesOf(const ConfigNode& list, const std::string& base) {
  if (list.kind() != ConfigNode::Kind::Map) throw list.error("a list file must be a map");
  std::vector<std::string> folders;
  if (const ConfigNode* node = list.find("searchPath")) folders = node->texts("searchPath");
  return SearchPath(base, folders);
}

ListFile::ListFile(const ConfigNode& list, const std::string& base)
    : list_(list),
      base_(base),
      files_(filesOf(list, base)),
      items_(list.find("loadControllers")),
      profiles_(list.find("profiles")) {
  if (!items_) throw list.error("a list file needs loadControllers: [names]");
  readShared();
  blocks_ = blocksOf(list);
  if (items_->kind() != ConfigNode::Kind::List) {
    throw items_->error("loadControllers expects a list of names");
  }
}

void ListFile::readShared() {
  const ConfigNode* node = list_.find("sharedSignals");
  if (!node) return;
  const std::string policy = node->text("sharedSignals");
  if (policy != "cascade" && policy != "refuse") {
    throw node->error("sharedSignals cannot be '" + policy + "'" +
                      suggestion(policy, {"cascade", "refuse"}));
  }
  refuse_shared_ = policy == "refuse";
}

ListFile::Controller ListFile::read(const ConfigNode& item) const {
  const std::string name = item.text("a name in loadControllers");
  const ConfigNode* block = list_.find(name);
  if (!block || std::find(blocks_.begin(), blocks_.end(), name) == blocks_.end()) {
    throw item.error("loadControllers lists '" + name + "', but there is no block '" + name + ":'" +
                     suggestion(name, blocks_));
  }
  return {name, readEntry(name, *block, files_, base_), block};
}

}  // namespace ctrl_more
