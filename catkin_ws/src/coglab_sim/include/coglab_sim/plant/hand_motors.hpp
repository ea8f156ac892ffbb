/// @file
/// The five motors of the hand: tendon travel and motor current.
#pragma once

#include <array>

#include "coglab_sim/plant/hand_table.hpp"

namespace coglab_sim::plant {

/// Command of a motor, valid until the next one.
struct MotorCommand {
  double speed = 0.0;    ///< share of the full speed, 0 .. 1; 0: off
  double target = 0.0;   ///< target as share of the stroke, 0 open .. 1 closed
  double current = 1e3;  ///< counts, motor current at which winding stops
};

/// State of a motor.
struct MotorState {
  double position = 0.0;  ///< share of the stroke, 0 open .. 1 closed
  double tension = 0.0;   ///< N
  double effort = 0.0;    ///< counts, current that corresponds to the tension
  double current = 0.0;   ///< counts as on the wire; 0 when off, at its target or locked
  bool moving = false;
  bool locked = false;  ///< stopped by resistance; the gear holds the tendon
};

/// With the current of a free-running motor as limit, a motor does not wind against resistance.
///
/// Motors wind tendons. Their speed falls to zero over the last fifth below the tension at which
/// they stop. A load never drives a motor backward. A motor that is nearly stopped for some time is
/// locked until the next command; otherwise shaking would tighten it step by step.
class HandMotors {
 public:
  explicit HandMotors(const HandTable& table) : table_(table) {}

  /// Sets the command. A changed command unlocks the motor.
  void command(int motor, const MotorCommand& command);
  /// Switches a motor off and sets its position (share of the stroke).
  void set(int motor, double position);
  /// Advances by `dt` s under the tensions (N) of the tendons.
  void step(const std::array<double, kMotors>& tension, double dt);

  const MotorState& state(int motor) const { return states_[static_cast<std::size_t>(motor)]; }
  /// Target of the tendon's servo, m.
  double wound(int motor) const;

 private:
  HandTable table_;
  std::array<MotorCommand, kMotors> commands_;
  std::array<MotorState, kMotors> states_;
  std::array<double, kMotors> slow_{};  // s, time nearly stopped
};

}  // namespace coglab_sim::plant
