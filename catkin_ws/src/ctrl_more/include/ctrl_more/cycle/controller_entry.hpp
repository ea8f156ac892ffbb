#pragma once

#include <string>

#include "ctrl_more/description/description.hpp"

namespace ctrl_more {

/// How a manager runs its controllers.
struct ManagerOptions {
  double blend_s = 0.2;   ///< time over which any change is blended in [s]; 0: at once
  bool timed = false;     ///< measure each update() on the steady clock, as is done anyway while
                          ///< any controller has an `overrun_us` to be judged
  bool lockstep = false;  ///< simulated time: overruns are not judged
  int overruns_to_pause = 5;      ///< overruns in a row that pause a controller
  bool check_undeclared = false;  ///< test mode: compare everything a controller did not declare
};

/// How one controller is to be loaded and run; what the list file says of it.
struct ControllerEntry {
  std::string type;                        ///< registered class; "": the only one in the library
  std::string library;                     ///< `libPath` resolved; "": linked into the program
  std::string config_file;                 ///< `configFile` resolved; "": defaults
  bool enabled = false;                    ///< enabled from the start
  double overrun_us = 0.0;                 ///< longest update() [us]; 0: not judged
  double blend_s = -1.0;                   ///< own blend time [s]; < 0: the manager's
  StopPolicy on_fault = StopPolicy::Fade;  ///< the last correction after a fault
};

}  // namespace ctrl_more
