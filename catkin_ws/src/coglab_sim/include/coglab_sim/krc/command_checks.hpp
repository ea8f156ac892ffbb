/// @file
/// Checks of commands. The texts are those of the controller's message window.
#pragma once

#include <string>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// State of the controller that a command is checked against.
struct CheckContext {
  const Parameters& parameters;
  lwr_fri_bridge::fri::ControlStrategy strategy;
  Vector7 set_point;            ///< rad, before this command
  Pose frame_set_point;         ///< of the tip, before this command
  Vector7 last_torque;          ///< added torque in force, Nm
  Vector7 speed_limit;          ///< rad/s
  std::uint32_t latched_flags;  ///< flags at entry; only for checkCyclic
};

/// Converts a 3x4 frame of the wire to a pose. False if it is not finite or not a rotation within
/// `tolerance`.
bool poseFromWire(const float (&wire)[lwr_fri_bridge::fri::kFrameValues], double tolerance,
                  Pose& pose);
/// Converts a pose to a 3x4 frame of the wire.
void poseToWire(const Pose& pose, float (&wire)[lwr_fri_bridge::fri::kFrameValues]);

/// First joint (0..6) whose set-point (rad) is beyond its software limit switch; -1: none.
int jointPastLimitSwitch(const Parameters& parameters, const Vector7& set_point);
/// Its line in the message window.
std::string limitSwitchMessage(int joint);

/// Reason why the command cannot start command mode; empty if it can.
std::string checkEntry(const CheckContext& context,
                       const lwr_fri_bridge::fri::CommandDatagram& command);

/// Reason why the command ends command mode; empty if it is accepted.
std::string checkCyclic(const CheckContext& context,
                        const lwr_fri_bridge::fri::CommandDatagram& command);

}  // namespace coglab_sim::krc
