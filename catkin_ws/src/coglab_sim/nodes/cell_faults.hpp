/// @file
/// The faults that the service ~fault of the cell can make, by name.
#pragma once

#include <string>

#include "coglab_sim/real_time_cell.hpp"

namespace coglab_sim {

/// Makes a fault now and, where it is a condition, undoes it after `duration` s of simulated time
/// (0: it stays).
///
///   block               1: somebody holds the arm where it is, 0: lets go
///   packet_loss         share 0..1 of datagrams lost, each way
///   lose_packets        number of successive periods lost, both ways
///   silence             the controller sends nothing for `value` s
///   drive_error         joint 0..6 reports an error; its end is acknowledged too
///   enabling_switch     0: released, 1: pressed (in Automatic: operator safety)
///   leave_command_mode  fall-back as after a fault
///   reopen              the KRL program is started anew with an FRI period of `value` s
///   acknowledge         the operator acknowledges the controller's messages
///
/// @throws std::invalid_argument with the known kinds, or naming value and range.
void injectFault(RealTimeCell& cell, const std::string& kind, double value, double duration);

}  // namespace coglab_sim
