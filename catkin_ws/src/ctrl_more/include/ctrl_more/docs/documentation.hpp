#pragma once

#include <map>
#include <string>
#include <vector>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/description/setup.hpp"

namespace ctrl_more {

/// One controller as plot() shows it: declaration, present state, signals, gains.
struct ControllerPlot {
  std::string name;                                  ///< of the instance
  Description description;                           ///< what it declares
  bool enabled = false;                              ///< as requested
  bool paused = false;                               ///< for any reason
  std::vector<ResolvedRobotUse> robot;               ///< what it reads of the robot
  std::vector<ResolvedControlUse> control;           ///< what it reads and modifies
  std::map<std::string, std::vector<double>> gains;  ///< present values
};

/// What plot() prints of one controller.
std::string plotText(const ControllerPlot& controller);

/// The documentation page of a controller in Markdown, from its description alone.
std::string documentationPage(const Description& description);

/// A configuration file with every gain and setting at its initial value, each with unit, range
/// and text as a comment.
std::string configurationTemplate(const Description& description);

}  // namespace ctrl_more
