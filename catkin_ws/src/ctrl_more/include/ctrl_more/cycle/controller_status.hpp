#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

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
