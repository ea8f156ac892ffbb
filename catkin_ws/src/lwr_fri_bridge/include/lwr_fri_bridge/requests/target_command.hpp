/// @file
/// What a message on target_joint_states must be to move the arm. No ROS here.
///
/// A velocity counts as old as it is: its age runs from where it was made, not from its arrival,
/// and the permission to move that it belongs to is the one of then. What was made before a `hold`
/// therefore moves nothing after `reset`, however long it was on its way.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

/// A message as it came.
struct TargetMessage {
  const std::vector<std::string>& names;  ///< empty (wire order), or all seven
  const std::vector<double>& velocities;  ///< rad/s, in the order of the names
  bool stamped = false;                   ///< its stamp is not zero
  std::int64_t age_ns = 0;                ///< since its stamp; negative: from the future
  const std::string& epoch;  ///< `motion_epoch` of the state it was made in; empty: not known
};

/// What it is judged by.
struct TargetPermission {
  std::uint32_t epoch = 0;      ///< of the newest sample
  std::int64_t since_ns = 0;    ///< steady clock, when that epoch began
  std::int64_t now_ns = 0;      ///< steady clock
  std::int64_t longest_ns = 0;  ///< age at which a velocity ends
};

enum class TargetFault : std::uint8_t {
  None,
  Invalid,  ///< wrong length, an unknown joint, not finite
  Stamp,    ///< no stamp, too old, or from the future
  Epoch     ///< made before motion was allowed as it is now
};

/// The command to follow, or what is wrong with the message in words.
struct TargetVerdict {
  TargetFault fault = TargetFault::None;
  std::string sentence;     ///< empty without a fault
  VelocityCommand command;  ///< only without a fault
};

/// Judges a message. Never throws but for want of memory.
TargetVerdict judgeTarget(const TargetMessage& message, const TargetPermission& permission);

}  // namespace lwr_fri_bridge
