/// @file
/// Codes of coglab_msgs/ReasonCode for the messages of the bridge.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace lwr_fri_bridge {

/// Code of the reason why motion is not allowed.
std::uint16_t reasonCode(MotionBlock block);
/// The same, with the cause of a loss of command mode.
std::uint16_t reasonCode(MotionBlock block, const CommandModeLoss& loss);
/// Code of the outcome of a request.
std::uint16_t reasonCode(OutcomeCode code);

}  // namespace lwr_fri_bridge
