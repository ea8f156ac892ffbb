/// @file
/// What an arm and its controllers tell each other: one RobotSample per measurement, one
/// VelocityCommand per control cycle.
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace coglab_rt {

/// Joint-space vector in the arm's order, from base to flange: see JointLimits::names.
using Vector7 = Eigen::Matrix<double, 7, 1>;
/// Force (N) and torque (Nm): Fx Fy Fz Tx Ty Tz.
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Why motion is not allowed at the moment; the words are in `describe()`.
enum class MotionBlock : std::uint8_t {
  None,          ///< motion is allowed
  Disconnected,  ///< no measurement within the arm's time limit
  Monitor,       ///< the robot controller only measures; it has not been started
  NoPower,       ///< not all drives are powered
  NotStarted,    ///< no `start` since the last stop or fall-back
  Held,          ///< `hold` is latched until `reset`
  Stopping,      ///< `stop` was asked for; braking or waiting for monitor mode
  Leashed,  ///< the set-point ran ahead of the arm; it returns, and the motion must be asked for
            ///< anew
  PoorQuality,  ///< the controller judged the connection unacceptable; stopped until `start`
  DriveError    ///< a drive reported an error, with or without power; stopped until `start`
};

/// Words for a MotionBlock, for messages to the user.
inline const char* describe(MotionBlock block) {
  switch (block) {
    case MotionBlock::None:
      return "";
    case MotionBlock::Disconnected:
      return "no measurements from the robot controller";
    case MotionBlock::Monitor:
      return "the robot controller is in monitor mode; send start";
    case MotionBlock::NoPower:
      return "not all drives have power; check enabling switch and emergency stop, then send start";
    case MotionBlock::NotStarted:
      return "command mode without an explicit start; send start";
    case MotionBlock::Held:
      return "hold is latched; send reset";
    case MotionBlock::Stopping:
      return "stop was asked for";
    case MotionBlock::Leashed:
      return "the set-point ran ahead of the arm, something blocks it; ask for the motion anew";
    case MotionBlock::PoorQuality:
      return "the robot controller judged the connection unacceptable: answers were missing or "
             "late; look at answer rate and latency on /diagnostics, relieve this computer or its "
             "network, then send start";
    case MotionBlock::DriveError:
      return "a drive reported an error; read its message on the pendant, remove the cause, "
             "acknowledge it there, then send start";
  }
  return "?";
}

/// The event of `command` that takes the reason away, such as "start"; empty if none does.
inline const char* wayOut(MotionBlock block) {
  switch (block) {
    case MotionBlock::Monitor:
    case MotionBlock::NoPower:
    case MotionBlock::NotStarted:
      return "start";
    case MotionBlock::Held:
      return "reset";
    default:
      return "";
  }
}

/// What one measurement tells the controllers.
struct RobotSample {
  std::uint64_t sequence =
      0;  ///< number of measurements since the arm's interface started; 0: none yet
  std::int64_t stamp_ns = 0;  ///< time of receipt, steady clock (lockstep: simulated time), ns
  double cycle_time = 0.0;    ///< period of the measurements, s
  std::int64_t controller_ns =
      0;  ///< time by the robot controller's counter, lost cycles included, ns;
          ///< differences are the true dt (silence that ended the session counts one cycle)
  Vector7 position = Vector7::Zero();         ///< measured, rad
  Vector7 velocity = Vector7::Zero();         ///< from the velocity filter, rad/s
  Vector7 torque = Vector7::Zero();           ///< measured, Nm
  Vector7 external_torque = Vector7::Zero();  ///< estimated by the robot controller, Nm
  Vector6 tool_wrench = Vector6::Zero();  ///< estimated by the robot controller, about the tool's
                                          ///< origin in the tool's axes
  Vector7 commanded_position = Vector7::Zero();      ///< set-point of the arm, rad
  Vector7 commanded_velocity = Vector7::Zero();      ///< of that set-point, rad/s
  Vector7 commanded_acceleration = Vector7::Zero();  ///< of that set-point, rad/s^2
  MotionBlock block = MotionBlock::Disconnected;     ///< None: target velocities are followed
  std::int8_t blocking_joint = -1;  ///< Leashed: index of the joint that ran ahead, else -1
  std::uint32_t motion_epoch =
      0;  ///< grows whenever motion is blocked or allowed again: abort what is running
  /// What the arm's own guard keeps before a joint's stop beside the margin of JointLimits: the way
  /// of so many seconds at constant speed, and so many rad. Who plans motions keeps the same.
  double stop_delay = 0.0, stop_rounding = 0.0;
};

/// A target velocity of the control thread.
struct VelocityCommand {
  Vector7 velocity = Vector7::Zero();  ///< rad/s
  std::int64_t stamp_ns = 0;           ///< steady clock (lockstep: simulated time); 0: no command
  std::uint32_t motion_epoch =
      0;  ///< epoch of the sample it was computed from; older ones are ignored
};

}  // namespace coglab_rt
