/// @file
/// Conditions for a message on target_joint_states to move the arm. No ROS here.
///
/// The age of a velocity counts from its stamp, not from its arrival. It belongs to the motion
/// epoch in which it was made. A velocity from before a `hold` therefore never moves the arm after
/// `reset`, however late it arrives.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

/// A received message.
struct TargetMessage {
  const std::vector<std::string>& names;  ///< empty (wire order), or all seven
  const std::vector<double>& velocities;  ///< rad/s, in the order of the names
  bool stamped = false;                   ///< true if its stamp is not zero
  std::int64_t age_ns = 0;                ///< since its stamp; negative: from the future
  const std::string& epoch;               ///< `motion_epoch` in which it was made; empty: unknown
};

/// Current permission to move.
struct TargetPermission {
  std::uint32_t epoch = 0;      ///< epoch of the newest sample
  std::int64_t since_ns = 0;    ///< start of that epoch, steady clock
  std::int64_t now_ns = 0;      ///< steady clock
  std::int64_t longest_ns = 0;  ///< longest age of a velocity
};

enum class TargetFault : std::uint8_t {
  None,
  Invalid,  ///< wrong length, an unknown joint, not finite
  Stamp,    ///< no stamp, too old, or from the future
  Epoch     ///< made before the current motion epoch
};

/// The command to follow, or the error of the message.
struct TargetVerdict {
  TargetFault fault = TargetFault::None;
  std::string sentence;     ///< error message; empty without a fault
  VelocityCommand command;  ///< valid only without a fault
};

/// Checks a message. Throws only std::bad_alloc.
TargetVerdict judgeTarget(const TargetMessage& message, const TargetPermission& permission);

}  // namespace lwr_fri_bridge
