#pragma once

#include <fstream>

#include "test_support.hpp"

namespace ctrl_more {

/// A rig that loads one shipped library with a configuration text; nothing is blended.
struct ControllerRig : Rig {
  explicit ControllerRig(double blend_s = 0.0) : Rig(blend_s) {}

  Status load(const std::string& library, const std::string& configuration,
              const std::string& name = "c") {
    const std::string file = ::testing::TempDir() + "/ctrl_more_" + library + "_" + name + ".yaml";
    std::ofstream(file) << configuration;
    ControllerEntry entry;
    entry.library = std::string(CTRL_MORE_PLUGIN_DIR) + "/libctrl_more_" + library + ".so";
    entry.config_file = file;
    entry.enabled = true;
    return manager->loadController(name, entry);
  }

  /// One cycle with the references as they are.
  void cycleOnce(double dt = 0.005) {
    cycle.dt = dt;
    cycle.now_ns += static_cast<std::int64_t>(1e9 * dt);
    ++cycle.number;
    manager->update(cycle, robot, control);
  }
};

}  // namespace ctrl_more
