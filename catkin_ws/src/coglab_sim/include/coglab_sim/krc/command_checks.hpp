/// @file
/// What the controller refuses in a command, with the words users know from its message window.
#pragma once

#include <string>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// What a command is judged against.
struct CheckContext {
  const Parameters& parameters;
  lwr_fri_bridge::fri::ControlStrategy strategy;
  Vector7 set_point;            ///< rad, before this command
  Pose frame_set_point;         ///< of the tip, before this command
  Vector7 last_torque;          ///< added torque in force, Nm
  Vector7 speed_limit;          ///< rad/s
  std::uint32_t latched_flags;  ///< of entry; only for checkCyclic
};

/// A 3x4 frame of the wire as pose; false if it is not a rotation within `tolerance` or not finite.
bool poseFromWire(const float (&wire)[lwr_fri_bridge::fri::kFrameValues], double tolerance,
                  Pose& pose);
/// A pose as 3x4 frame of the wire.
void poseToWire(const Pose& pose, float (&wire)[lwr_fri_bridge::fri::kFrameValues]);

/// The first joint (0..6) whose software limit switch this set-point (rad) lies beyond; -1: none.
int jointPastLimitSwitch(const Parameters& parameters, const Vector7& set_point);
/// The line of the message window about it.
std::string limitSwitchMessage(int joint);

/// Sentence why the command cannot start command mode; empty if it can.
std::string checkEntry(const CheckContext& context,
                       const lwr_fri_bridge::fri::CommandDatagram& command);

/// Sentence why the command ends command mode; empty if it is followed.
std::string checkCyclic(const CheckContext& context,
                        const lwr_fri_bridge::fri::CommandDatagram& command);

}  // namespace coglab_sim::krc
