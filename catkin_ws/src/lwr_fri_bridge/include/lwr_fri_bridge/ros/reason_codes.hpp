/// @file
/// The numbers of coglab_msgs/ReasonCode for what the bridge says in words.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace lwr_fri_bridge {

/// Why motion is not allowed.
std::uint16_t reasonCode(MotionBlock block);
/// The same, with how command mode was lost.
std::uint16_t reasonCode(MotionBlock block, const CommandModeLoss& loss);
/// How a request ended.
std::uint16_t reasonCode(OutcomeCode code);

}  // namespace lwr_fri_bridge
