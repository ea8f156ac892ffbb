/// @file
/// Interface between Ctrl-MORE's managers and the control cycle: the shared stores of the arm and
/// their signals.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/manager/signal_inputs.hpp"
#include "coglab_rt/triple_buffer.hpp"
#include "ctrl_more/central_module.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace coglab_controllers {

/// The stores that all controllers of the arm share, and the central module with the managers.
///
/// Signals. measuredData: `joint_position` (rad), `joint_velocity` (rad/s), `joint_torque`,
/// `external_torque` (Nm), 7 each in wire order; `wrench` (N, Nm at the tool, in the base frame,
/// 6); if the hand has touch sensors `touch` (N, tool frame, 18: thumb, index, middle, ring, little
/// finger, palm; x y z each). estimatedData: `ee` (m, quaternion; base frame, 7), the tool's pose
/// by the measured joints. signals() adds those of topics. References: taskSpaceReferencePose and
/// taskSpaceReferenceVel `ee`; jointSpaceReference `Position` and `Velocity`; otherReference
/// `speed_limit` (m/s).
class FeedbackStage {
 public:
  /// @param setup orientation of the measured wrench
  /// @param period intended cycle time, s
  /// @param lockstep simulated time: overruns of feedback controllers are not checked
  /// @param logger for feedback controllers; null: Logger::standard()
  FeedbackStage(const RobotSetup& setup, double period, bool lockstep,
                ctrl_more::Logger* logger = nullptr);

  /// The managers in their order; without a file only the feedback manager.
  ctrl_more::CentralModule& central() { return *central_; }
  /// Replaces the managers by those of a file; before the first cycle.
  /// @param file path
  /// @param folders searched for libraries of managers
  /// @throws ctrl_more::ConfigError  the managers then stay as they are
  void loadCentral(const std::string& file, const std::vector<std::string>& folders);
  ctrl_more::FeedbackControllersManager& manager() { return central_->feedbackControllers(); }
  const ctrl_more::FeedbackControllersManager& manager() const {
    return central_->feedbackControllers();
  }
  References& references() { return references_; }
  const ctrl_more::RobotStates& robot() const { return robot_; }
  /// The robot signals that come from messages.
  SignalInputs& signals() { return signals_; }
  const SignalInputs& signals() const { return signals_; }
  /// Adds rows of a file of signals, all or nothing. Only before the first cycle.
  ctrl_more::Status addSignals(const std::vector<SignalInput>& rows) {
    return signals_.add(rows, robot_);
  }

  /// References at the end of a cycle.
  struct Snapshot {
    std::int64_t stamp_ns = 0;   ///< of the cycle; 0: none yet
    std::vector<double> values;  ///< offsets as in ControlSignal::offset()
  };
  /// Records the references of each cycle for readReferences(). Call it after the first cycle,
  /// which fixes their layout.
  void recordReferences() { snapshots_.emplace(Snapshot{0, snapshotValues()}); }
  /// The newest record; one thread at a time. False before recordReferences() and the next cycle.
  bool readReferences(Snapshot& snapshot) {
    return snapshots_ && (snapshots_->read(snapshot), snapshot.stamp_ns != 0);
  }

  /// @name In the cycle: no allocation, no lock
  /// @{

  /// Adopts the newest plan of the feedback manager; called once per cycle, idle ones included.
  void begin(std::int64_t now_ns, double dt) noexcept;
  /// Applies the feedback profile of a motion controller, in the cycle that switches to it.
  void switchProfile() noexcept { manager().adoptPrepared(); }
  /// True: feedback controllers drop their corrections, because the arm must rest at its position.
  void letGo(bool let_go) noexcept { manager().letGo(let_go); }
  /// Step 2: writes the measurement to the robot states. If a number is not finite, it writes
  /// nothing and returns false.
  bool fill(const CycleInput& input) noexcept;
  /// Runs the managers' stage (steps 5 and 7).
  void run(ctrl_more::Stage stage) noexcept { central_->run(stage); }
  /// Closes the cycle.
  void end() noexcept;
  /// @}

 private:
  std::vector<double> snapshotValues() const;
  std::unique_ptr<ctrl_more::CentralModule> makeCentral(const ctrl_more::ConfigNode& file,
                                                        const std::string& base,
                                                        const std::vector<std::string>& folders);

  Quaternion tool_from_wrench_;
  ctrl_more::RobotStates robot_;
  References references_;
  ctrl_more::RobotSignal position_, velocity_, torque_, external_, wrench_, pose_, arm_points_;
  int elbow_joint_ = 0, wrist_joint_ = 0;
  SignalInputs signals_;
  std::optional<coglab_rt::TripleBuffer<Snapshot>> snapshots_;
  ctrl_more::ManagerOptions options_;
  ctrl_more::Logger* logger_;
  std::unique_ptr<ctrl_more::CentralModule> central_;
  ctrl_more::Cycle now_;
};

}  // namespace coglab_controllers
