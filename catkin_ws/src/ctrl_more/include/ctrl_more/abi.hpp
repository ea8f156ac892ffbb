#pragma once

#include <cstddef>
#include <string>

#include <Eigen/Core>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// What a controller library and the program that loads it must have in common. The compiler fills
/// it in on both sides; a library whose numbers differ would read and write in the wrong places,
/// and is refused.
struct Abi {
  int interface;     ///< version of these headers: raised when classes or meanings change
  int compiler_abi;  ///< `__GXX_ABI_VERSION`
  int eigen;         ///< Eigen's version, 10000 world + 100 major + minor
  int eigen_align;   ///< alignment that Eigen assumes [bytes]; depends on `-march`
  std::size_t controller;      ///< size of FeedbackController [bytes]
  std::size_t robot_states;    ///< size of RobotStates [bytes]
  std::size_t control_states;  ///< size of ControlStates [bytes]
  std::size_t modified;        ///< size of ModifiedControlStates [bytes]
  std::size_t description;     ///< size of Description [bytes]
  std::size_t parts;           ///< sizes of its parts together [bytes]
  std::size_t setup;           ///< size of Setup [bytes]
  std::size_t cycle;           ///< size of Cycle [bytes]

  /// True if every number is the same.
  bool operator==(const Abi& other) const {
    return interface == other.interface && compiler_abi == other.compiler_abi &&
           eigen == other.eigen && eigen_align == other.eigen_align &&
           controller == other.controller && robot_states == other.robot_states &&
           control_states == other.control_states && modified == other.modified &&
           description == other.description && parts == other.parts && setup == other.setup &&
           cycle == other.cycle;
  }

  /// All numbers, for messages.
  std::string text() const {
    return "interface " + std::to_string(interface) + ", compiler ABI " +
           std::to_string(compiler_abi) + ", Eigen " + std::to_string(eigen) + " aligned to " +
           std::to_string(eigen_align) + ", sizes " + std::to_string(controller) + " " +
           std::to_string(robot_states) + " " + std::to_string(control_states) + " " +
           std::to_string(modified) + " " + std::to_string(description) + " " +
           std::to_string(parts) + " " + std::to_string(setup) + " " + std::to_string(cycle);
  }
};

/// The numbers of the file that is being compiled. Static, so that a library keeps its own.
static inline constexpr Abi thisAbi() {
  return {2,
          __GXX_ABI_VERSION,
          10000 * EIGEN_WORLD_VERSION + 100 * EIGEN_MAJOR_VERSION + EIGEN_MINOR_VERSION,
          EIGEN_MAX_ALIGN_BYTES,
          sizeof(FeedbackController),
          sizeof(RobotStates),
          sizeof(ControlStates),
          sizeof(ModifiedControlStates),
          sizeof(Description),
          sizeof(RobotSignalUse) + sizeof(ControlSignalUse) + sizeof(GainSpec) +
              sizeof(SettingSpec) + sizeof(StateSpec),
          sizeof(Setup),
          sizeof(Cycle)};
}

}  // namespace ctrl_more
