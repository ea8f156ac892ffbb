#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/loading/search_path.hpp"
#include "ctrl_more/manager/controller_status.hpp"

namespace ctrl_more {

/// Reads and checks a list file of controllers (Ctrl-MORE paper, section III-A). Errors are
/// ConfigErrors, or sentences with the name of the controller.
class ListFile {
 public:
  /// One listed controller.
  struct Controller {
    std::string name;         ///< its name
    ControllerEntry entry;    ///< its options
    const ConfigNode* block;  ///< its block in the file
  };

  /// @param list parsed list, which must outlive this object
  /// @param base folder for relative paths
  ListFile(const ConfigNode& list, const std::string& base);

  /// The items of `loadControllers`.
  const std::vector<ConfigNode>& items() const { return items_->items(); }
  /// Options of one item. Throws.
  Controller read(const ConfigNode& item) const;
  /// `sharedSignals`, if the file has it: true for `refuse`.
  std::optional<bool> refuseShared() const { return refuse_shared_; }
  /// The map of profiles; null if there is none.
  const ConfigNode* profiles() const { return profiles_; }

 private:
  static SearchPath filesOf(const ConfigNode& list, const std::string& base);
  void readShared();

  const ConfigNode& list_;
  std::string base_;
  SearchPath files_;
  std::vector<std::string> blocks_;
  const ConfigNode* items_;
  const ConfigNode* profiles_;
  std::optional<bool> refuse_shared_;
};

}  // namespace ctrl_more
