#pragma once

#include <map>
#include <string>
#include <vector>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/description/setup.hpp"

namespace ctrl_more {

/// Content of plot() for one controller: declaration, current state, signals, gains.
struct ControllerPlot {
  std::string name;                                  ///< name of the instance
  Description description;                           ///< its declaration
  bool enabled = false;                              ///< as requested
  bool paused = false;                               ///< for any reason
  std::vector<ResolvedRobotUse> robot;               ///< robot signals that it reads
  std::vector<ResolvedControlUse> control;           ///< control signals that it reads or modifies
  std::map<std::string, std::vector<double>> gains;  ///< current values
};

/// Text that plot() prints for one controller.
std::string plotText(const ControllerPlot& controller);

/// Documentation page of a controller in Markdown, made from its description.
std::string documentationPage(const Description& description);

/// Configuration file with all gains and settings at their initial values. Comments give unit,
/// range and text of each.
std::string configurationTemplate(const Description& description);

}  // namespace ctrl_more
