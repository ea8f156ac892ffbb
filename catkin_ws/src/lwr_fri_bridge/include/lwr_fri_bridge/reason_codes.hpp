/// @file
/// The numbers of coglab_msgs/ReasonCode for what the bridge says in words.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/bridge.hpp"

namespace lwr_fri_bridge {

/// Why motion is not allowed.
std::uint16_t reasonCode(MotionBlock block);
/// The same, with how command mode was lost.
std::uint16_t reasonCode(MotionBlock block, const CommandModeLoss& loss);
/// How a request ended.
std::uint16_t reasonCode(OutcomeCode code);

/// The reason for which the robot's interface does not allow motion, from its number; NotStarted
/// for a number that is none of those.
MotionBlock motionBlockOf(std::uint16_t reason_code);

}  // namespace lwr_fri_bridge
