/// @file
/// What to tell a user about a poor connection.
#pragma once

#include <string>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace lwr_fri_bridge {

/// How bad a situation is, as in diagnostic_msgs/DiagnosticStatus.
enum class Severity : std::uint8_t { Ok = 0, Warning = 1, Error = 2 };

struct Diagnosis {
  Severity severity = Severity::Ok;
  std::string text;
  ReasonCode code = ReasonCode::None;  ///< what the text means, for programs
};

/// Connection: silence, quality, latency, losses, a second sender, with a hint what to do. `port`
/// is the bound one, `silence` (s) the time since the last datagram or since the start.
Diagnosis diagnoseConnection(const Snapshot& snapshot, const FriThreadStatistics& thread, int port,
                             double silence);

/// Arm: drive errors and warnings (by joint), temperatures above `hot` (degree Celsius), why motion
/// is not allowed.
Diagnosis diagnoseArm(const Snapshot& snapshot, double hot);

/// Why motion is not allowed at the moment, in words, naming the joint if one is the reason, and
/// how command mode was lost if it was; empty if motion is allowed.
std::string reasonOf(MotionBlock block, int joint, const CommandModeLoss& loss = {});

/// The same as a number: None if motion is allowed.
ReasonCode codeOf(MotionBlock block, const CommandModeLoss& loss);

}  // namespace lwr_fri_bridge
