#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/description/description.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

/// Options of a manager.
struct ManagerOptions {
  double blend_s = 0.2;       ///< blend time of every change [s]; 0: at once
  bool timed = false;         ///< measure each update() on the steady clock; always done while any
                              ///< controller has an `overrun_us`
  bool lockstep = false;      ///< simulated time: overruns are not judged
  int overruns_to_pause = 5;  ///< overruns in a row that pause a controller
  bool check_undeclared = false;  ///< test mode: check all signals a controller did not declare
};

/// Options of one controller: its block in the list file.
struct ControllerEntry {
  std::string type;         ///< registered class; "": the only one in the library;
                            ///< `module:Class`: a script type
  std::string library;      ///< `libPath` resolved; "": linked into the program; of a
                            ///< script type: folder of its module
  std::string config_file;  ///< `configFile` resolved; "": defaults
  bool enabled = false;     ///< enabled from the start
  double overrun_us = 0.0;  ///< longest update() [us]; 0: not judged
  double blend_s = -1.0;    ///< own blend time [s]; < 0: the manager's
  StopPolicy on_fault = StopPolicy::Fade;  ///< policy for the last correction after a fault
};

/// Current activity of a controller in the control cycle.
enum class Activity : std::uint8_t {
  Off,       ///< contributes nothing; the control states pass unchanged
  Running,   ///< update() is called each cycle
  Stopping,  ///< disabled, paused or faulted: the last correction is held or fading
  Waiting,   ///< enabled, but a robot signal it needs is missing or too old, or letGo() holds
};

/// `off`, `running`, `stopping` or `waiting`.
const char* nameOf(Activity activity);

/// Why the guard stopped a controller.
enum class FaultKind : std::uint8_t {
  None,
  Exception,       ///< update() threw
  Declared,        ///< the controller called fail()
  NotFinite,       ///< it wrote a NaN or an infinity
  NotUnit,         ///< it wrote a quaternion whose norm differs from 1 by more than 1e-6
  CorrectionSize,  ///< its correction is larger than its description allows
  CorrectionRate,  ///< its correction changes faster than its description allows
  Undeclared,      ///< it changed a signal it did not declare (checked in test mode only)
  Overrun,         ///< too slow in too many cycles in a row
};

/// Text of a kind of fault.
const char* nameOf(FaultKind kind);

/// Cause of a pause.
enum class PauseCause : std::uint8_t {
  User,    ///< a request by its name
  Signal,  ///< a request by a signal that it uses
  Fault    ///< its latched fault
};

/// State of one controller for users, services and displays.
struct ControllerStatus {
  std::string name;                   ///< instance
  std::string type;                   ///< class
  Stage stage = Stage::Task;          ///< stage in which it runs
  bool enabled = false;               ///< as requested
  bool paused = false;                ///< for any reason, including a latched fault
  bool safety = false;                ///< refuses pause and disable unless forced
  std::vector<std::string> reasons;   ///< reasons of the pause
  std::vector<PauseCause> causes;     ///< cause of each reason
  Activity activity = Activity::Off;  ///< activity in the cycle
  FaultKind fault = FaultKind::None;  ///< the latched fault
  std::string fault_text;             ///< the latched fault in words
  std::uint64_t fault_cycle = 0;      ///< cycle of the latched fault
  std::uint64_t faults = 0;           ///< number of faults since loading
  std::uint64_t overruns = 0;         ///< number of overruns since loading
  double last_us = 0.0;               ///< duration of the last update() [us], 0 unless timed
  std::string waiting_for;  ///< robot signal it waits for; `a motion` after letGo(); "" if none
};

/// Change of one reference by one controller in one cycle.
struct Attribution {
  std::string controller;      ///< instance
  std::string signal;          ///< `container/key`
  std::uint64_t cycle = 0;     ///< cycle of the change
  std::vector<double> before;  ///< reference before the controller
  std::vector<double> after;   ///< reference after the controller, rollback and blending
  double size = 0.0;   ///< norm of the change (of the position for poses) [unit of the signal]
  double angle = 0.0;  ///< angle of the change of an orientation [rad]
};

/// Internal numbers of a controller in one cycle.
struct ControllerState {
  std::string controller;      ///< instance
  std::vector<double> values;  ///< in the order of Description::states
};

/// Record of one cycle, without controllers that were off.
struct CycleRecord {
  std::uint64_t cycle = 0;              ///< cycle number
  std::vector<Attribution> changes;     ///< changes of references, in execution order
  std::vector<ControllerState> states;  ///< declared states, in execution order
};

}  // namespace ctrl_more
