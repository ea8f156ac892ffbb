/// @file
/// Interface between Ctrl-MORE's feedback controllers and the control cycle: the shared stores of
/// the arm and their signals.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "coglab_controllers/manager/motion_controller.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "ctrl_more/states/signal_mailbox.hpp"

namespace coglab_controllers {

/// Contact forces on thumb, index, middle, ring, little finger and palm; x y z each, N, axes of the
/// tool.
using TouchForces = std::array<double, 18>;

/// The stores that all controllers of the arm share, and their feedback manager.
///
/// Signals. measuredData: `joint_position` (rad), `joint_velocity` (rad/s), `joint_torque`,
/// `external_torque` (Nm), 7 each in wire order; `wrench` (N, Nm at the tool, in the base frame,
/// 6); with `tactile` set `touch` (N, tool frame, 18: see TouchForces). estimatedData: `ee` (m,
/// quaternion; base frame, 7), the tool's pose by the measured joints. References:
/// taskSpaceReferencePose and taskSpaceReferenceVel `ee`; jointSpaceReference `Position` and
/// `Velocity`.
class FeedbackStage {
 public:
  /// @param setup orientation of the measured wrench
  /// @param period intended cycle time, s
  /// @param lockstep simulated time: overruns of feedback controllers are not checked
  /// @param logger for feedback controllers; null: Logger::standard()
  FeedbackStage(const RobotSetup& setup, double period, bool lockstep,
                ctrl_more::Logger* logger = nullptr);

  ctrl_more::FeedbackControllersManager& manager() { return manager_; }
  const ctrl_more::FeedbackControllersManager& manager() const { return manager_; }
  References& references() { return references_; }
  const ctrl_more::RobotStates& robot() const { return robot_; }
  /// Stores forces of touch sensors for the next cycle. Wait-free; one thread at a time.
  /// @param stamp_ns monotonic nanoseconds
  /// @return false if the hand has no touch sensors
  bool postTouch(const TouchForces& forces, std::int64_t stamp_ns) noexcept {
    return touch_ && touch_->post(forces.data(), static_cast<int>(forces.size()), stamp_ns);
  }

  /// @name In the cycle: no allocation, no lock
  /// @{

  /// Adopts the newest plan of the feedback manager; called once per cycle, idle ones included.
  void begin(std::int64_t now_ns, double dt) noexcept;
  /// Applies the feedback profile of a motion controller, in the cycle that switches to it.
  void switchProfile() noexcept { manager_.adoptPrepared(); }
  /// Step 2: writes the measurement to the robot states. If a number is not finite, it writes
  /// nothing and returns false.
  bool fill(const CycleInput& input) noexcept;
  /// Runs the feedback controllers of a stage (steps 5 and 7).
  void run(ctrl_more::Stage stage) noexcept {
    manager_.updateStage(stage, robot_, references_.states);
  }
  /// Closes the cycle.
  void end() noexcept { manager_.endCycle(); }
  /// @}

 private:
  Quaternion tool_from_wrench_;
  ctrl_more::RobotStates robot_;
  References references_;
  ctrl_more::RobotSignal position_, velocity_, torque_, external_, wrench_, pose_;
  std::optional<ctrl_more::SignalMailbox> touch_;
  ctrl_more::FeedbackControllersManager manager_;
  std::uint64_t number_ = 0;
};

}  // namespace coglab_controllers
