/// @file
/// Messages to the user about problems of the connection and the arm.
#pragma once

#include <string>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace lwr_fri_bridge {

/// Severity levels of diagnostic_msgs/DiagnosticStatus.
enum class Severity : std::uint8_t { Ok = 0, Warning = 1, Error = 2 };

struct Diagnosis {
  Severity severity = Severity::Ok;
  std::string text;
  ReasonCode code = ReasonCode::None;  ///< meaning of the text, for programs
};

/// Diagnoses the connection (silence, quality, latency, losses, a second sender) and suggests a
/// remedy. `port` is the bound port, `silence` (s) the time since the last datagram or the start.
Diagnosis diagnoseConnection(const Snapshot& snapshot, const FriThreadStatistics& thread, int port,
                             double silence);

/// Diagnoses the arm: drive errors and warnings (by joint), temperatures above `hot` (degree
/// Celsius), the reason why motion is not allowed.
Diagnosis diagnoseArm(const Snapshot& snapshot, double hot);

/// Text of the reason why motion is not allowed, with the joint (if one is the reason) and the loss
/// of command mode (if there was one). Empty if motion is allowed.
std::string reasonOf(MotionBlock block, int joint, const CommandModeLoss& loss = {});

/// Code of the same reason; None if motion is allowed.
ReasonCode codeOf(MotionBlock block, const CommandModeLoss& loss);

}  // namespace lwr_fri_bridge
