/// @file
/// Events of `ros_events` and `command` (D4.10 Table 1), and their outcomes.
///
/// | event                                         | meaning                                   |
/// | --------------------------------------------- | ----------------------------------------- |
/// | start                                         | command mode: target velocities count     |
/// | hold                                          | brake and latch until reset               |
/// | reset                                         | release hold                              |
/// | stop                                          | brake, then monitor mode                  |
/// | position                                      | control mode for the next start           |
/// | joint_impedance [stiffness k] [damping d]     | k in Nm/rad, one value or seven; d alike  |
/// | cartesian_impedance [stiffness k] [damping d] | k in N/m and Nm/rad: translation rotation |
/// |                                               | or x y z Rx Ry Rz; d one, two or six      |
///
/// Values are separated by blanks or commas. Omitted values stay unchanged.
#pragma once

#include <cstdint>
#include <string>

#include "coglab_rt/reason.hpp"
#include "lwr_fri_bridge/fri/krl_convention.hpp"

namespace lwr_fri_bridge {

/// Control mode with its parameters. The defaults are those of existing clients (1000 Nm/rad, 2000
/// N/m, 200 Nm/rad, 0.7).
struct ControlMode {
  fri::ControlStrategy strategy = fri::ControlStrategy::Position;
  Vector7 joint_stiffness = Vector7::Constant(1000.0);  ///< Nm/rad, 0.01..2000
  Vector7 joint_damping = Vector7::Constant(0.7);       ///< normalised, 0.1..1
  Vector6 cartesian_stiffness =
      (Vector6() << 2000.0, 2000.0, 2000.0, 200.0, 200.0, 200.0).finished();
  ///< x y z (N/m, 0.01..5000) Rx Ry Rz (Nm/rad, 0.01..300)
  Vector6 cartesian_damping = Vector6::Constant(0.7);  ///< normalised, 0.1..1
};

enum class EventKind : std::uint8_t { Start, Hold, Reset, Stop, Mode };

struct Event {
  EventKind kind = EventKind::Hold;
  ControlMode mode;  ///< for Mode
};

/// Parses an event. `current` provides the values that the text omits.
/// @throws std::invalid_argument for an unknown event (with the list of known ones), or a wrong
/// number or range of values.
Event parseEvent(const std::string& text, const ControlMode& current);

/// Known events with their parameters, for messages.
const char* knownEvents();

enum class OutcomeCode : std::uint8_t {
  Pending,
  Done,
  AlreadyThere,    ///< nothing to do
  Disconnected,    ///< no datagrams from the controller
  Held,            ///< refused: hold is latched
  InCommandMode,   ///< refused: the control mode may change only in monitor mode
  NotSupported,    ///< the KRL convention cannot run this strategy
  PoorQuality,     ///< quality did not become OK in time
  NoKrlProgram,    ///< the controller shows no sign of the program of krl_convention
  ProgramRefused,  ///< the KRL program reported a failure
  NotEntered,      ///< command mode did not come in time
  NoPower,         ///< command mode came, but not all drives have power
  WrongStrategy,   ///< command mode came with another strategy
  NotLeft,         ///< monitor mode did not come in time
  Interrupted,     ///< interrupted by hold or stop
  Busy,            ///< refused: another start or stop is in progress
  LostConnection,  ///< the controller became silent during the request
  NotServed        ///< the FRI thread did not take the request
};

/// Outcome of a request, with the observations at its end.
struct Outcome {
  std::uint32_t ticket = 0;
  EventKind kind = EventKind::Hold;
  OutcomeCode code = OutcomeCode::Pending;
  fri::ControlStrategy wanted = fri::ControlStrategy::Other;
  fri::ControlStrategy reported = fri::ControlStrategy::Other;
  fri::FriState state = fri::FriState::Off;
  fri::Quality quality = fri::Quality::Unacceptable;
  fri::KrlConvention convention = fri::KrlConvention::Coglab;
  fri::KrlResult result = fri::KrlResult::None;
  std::uint16_t power = 0;
  std::uint16_t drive_error = 0;
  double waited = 0.0;  ///< s

  bool success() const { return code == OutcomeCode::Done || code == OutcomeCode::AlreadyThere; }
};

/// Text of the outcome: expected and actual state, and what to do next.
std::string describe(const Outcome& outcome);

/// Code of the outcome for programs; None for success and while it is pending.
coglab_rt::ReasonCode codeOf(OutcomeCode code);

}  // namespace lwr_fri_bridge
