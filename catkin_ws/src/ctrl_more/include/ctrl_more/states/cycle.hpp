#pragma once

#include <cstdint>

namespace ctrl_more {

/// Stage of the control cycle in which a controller runs.
enum class Stage : std::uint8_t {
  Task,   ///< between reference and inverse kinematics: task-space references
  Joint,  ///< after inverse kinematics: joint-space references
};

/// Number of stages.
constexpr int kStages = 2;

/// `task` or `joint`.
const char* nameOf(Stage stage);

/// Time of one control cycle.
struct Cycle {
  std::int64_t now_ns = 0;   ///< monotonic time at the start of the cycle [ns]
  double dt = 0.005;         ///< true time since the last cycle [s], > 0
  std::uint64_t number = 0;  ///< increases by one each cycle
};

}  // namespace ctrl_more
