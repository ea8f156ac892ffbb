/// @file
/// Faults of the service ~fault of the cell, by name.
#pragma once

#include <string>

#include "coglab_sim/real_time_cell.hpp"

namespace coglab_sim {

/// Makes a fault now. A lasting fault is undone after `duration` s of simulated time (0: it stays).
///
///   block               1: a person holds the arm in place, 0: releases it
///   packet_loss         share 0..1 of datagrams lost, in each direction
///   lose_packets        number of successive periods lost, in both directions
///   silence             the controller sends nothing for `value` s
///   drive_error         joint 0..6 reports an error; undoing it also acknowledges
///   enabling_switch     0: released, 1: pressed (in Automatic: operator safety)
///   leave_command_mode  fall-back as after a fault
///   reopen              the KRL program restarts with an FRI period of `value` s
///   acknowledge         the operator acknowledges the controller's messages
///
/// @throws std::invalid_argument with the known kinds, or naming value and range.
void injectFault(RealTimeCell& cell, const std::string& kind, double value, double duration);

}  // namespace coglab_sim
