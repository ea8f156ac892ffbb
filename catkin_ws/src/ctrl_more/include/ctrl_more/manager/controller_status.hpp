#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/signal.hpp"

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

/// How one controller is loaded and run: its block in the list file.
struct ControllerEntry {
  std::string type;                        ///< registered class; "": the only one in the library
  std::string library;                     ///< `libPath` resolved; "": linked into the program
  std::string config_file;                 ///< `configFile` resolved; "": defaults
  bool enabled = false;                    ///< enabled from the start
  double overrun_us = 0.0;                 ///< longest update() [us]; 0: not judged
  double blend_s = -1.0;                   ///< own blend time [s]; < 0: the manager's
  StopPolicy on_fault = StopPolicy::Fade;  ///< the last correction after a fault
};

/// What a controller does at present, as the control cycle sees it.
enum class Activity : std::uint8_t {
  Off,       ///< contributes nothing: identity on the control states
  Running,   ///< update() is called each cycle
  Stopping,  ///< disabled, paused or faulted: the last correction is held or fading
  Waiting,   ///< enabled, but a robot signal it needs is missing or too old
};

/// `off`, `running`, `stopping` or `waiting`.
const char* nameOf(Activity activity);

/// Why the guard stopped a controller.
enum class FaultKind : std::uint8_t {
  None,
  Exception,       ///< update() threw
  Declared,        ///< the controller called fail()
  NotFinite,       ///< it left a NaN or an infinity
  NotUnit,         ///< it left a quaternion whose norm is off by more than 1e-6
  CorrectionSize,  ///< its correction is larger than its description allows
  CorrectionRate,  ///< its correction changes faster than its description allows
  Undeclared,      ///< it changed a signal it did not declare (checked in test mode only)
  Overrun,         ///< too slow in too many cycles in a row
};

/// Words for a kind of fault.
const char* nameOf(FaultKind kind);

/// Who or what pauses a controller.
enum class PauseCause : std::uint8_t {
  User,    ///< a request by its name
  Signal,  ///< a request by a signal that it uses
  Fault    ///< its latched fault
};

/// State of one controller for users, services and displays.
struct ControllerStatus {
  std::string name;                   ///< instance
  std::string type;                   ///< class
  Stage stage = Stage::Task;          ///< where it runs
  bool enabled = false;               ///< as requested
  bool paused = false;                ///< for any reason, a latched fault included
  bool safety = false;                ///< refuses pause and disable unless forced
  std::vector<std::string> reasons;   ///< why it is paused
  std::vector<PauseCause> causes;     ///< of each of the reasons
  Activity activity = Activity::Off;  ///< what the cycle does with it
  FaultKind fault = FaultKind::None;  ///< the latched fault
  std::string fault_text;             ///< the latched fault in words
  std::uint64_t fault_cycle = 0;      ///< cycle of the latched fault
  std::uint64_t faults = 0;           ///< number of faults since loading
  std::uint64_t overruns = 0;         ///< number of overruns since loading
  double last_us = 0.0;               ///< duration of the last update() [us], 0 unless timed
  std::string waiting_for;            ///< robot signal it waits for, "" if none
};

/// Who changed which reference by how much in one cycle.
struct Attribution {
  std::string controller;      ///< instance
  std::string signal;          ///< `container/key`
  std::uint64_t cycle = 0;     ///< cycle of the change
  std::vector<double> before;  ///< reference as the controller found it
  std::vector<double> after;   ///< reference as it left it (rolled back and blended as it may be)
  double size = 0.0;   ///< norm of the change (of the position for poses) [unit of the signal]
  double angle = 0.0;  ///< angle of the change of an orientation [rad]
};

/// Numbers of a controller's inside in one cycle.
struct ControllerState {
  std::string controller;      ///< instance
  std::vector<double> values;  ///< in the order of Description::states
};

/// What the controllers did in one cycle; those that were off are left out.
struct CycleRecord {
  std::uint64_t cycle = 0;              ///< its number
  std::vector<Attribution> changes;     ///< who changed what, in execution order
  std::vector<ControllerState> states;  ///< of those that declare any, in execution order
};

}  // namespace ctrl_more
