/// @file
/// The five motors of the hand: what each winds up, and what it draws for it.
#pragma once

#include <array>

#include "coglab_sim/plant/hand_table.hpp"

namespace coglab_sim::plant {

/// What a motor does until the next command.
struct MotorCommand {
  double speed = 0.0;    ///< share of the full speed, 0 .. 1; 0: off
  double target = 0.0;   ///< share of the stroke to go to, 0 open .. 1 closed
  double current = 1e3;  ///< counts of motor current at which it stops winding
};

/// What a motor is doing.
struct MotorState {
  double position = 0.0;  ///< share of the stroke, 0 open .. 1 closed
  double tension = 0.0;   ///< N
  double effort = 0.0;    ///< counts of current that the tension stands for
  double current = 0.0;   ///< counts as on the wire; 0 when off, at its target or locked
  bool moving = false;
  bool locked = false;  ///< it met resistance and stands; its gear holds what it has wound
};

/// A command whose current is that of a motor running free winds nothing that resists.
///
/// Motors wind tendons at a speed that falls to nothing over the last fifth before the tension at
/// which they are to stop. A load never drives one backward. One that is nearly stopped for a
/// while is locked until the next command, else shaking would ratchet it tighter.
class HandMotors {
 public:
  explicit HandMotors(const HandTable& table) : table_(table) {}

  /// A command that differs from the one before unlocks the motor.
  void command(int motor, const MotorCommand& command);
  /// Puts a motor somewhere, off.
  void set(int motor, double position);
  /// Advances by `dt` s under the tensions (N) of the tendons.
  void step(const std::array<double, kMotors>& tension, double dt);

  const MotorState& state(int motor) const { return states_[static_cast<std::size_t>(motor)]; }
  /// m, what the tendon's servo is to hold.
  double wound(int motor) const;

 private:
  HandTable table_;
  std::array<MotorCommand, kMotors> commands_;
  std::array<MotorState, kMotors> states_;
  std::array<double, kMotors> slow_{};  // s for which it has been nearly stopped
};

}  // namespace coglab_sim::plant
