/// @file
/// Data between an arm and its controllers: one RobotSample per measurement, one VelocityCommand
/// per control cycle.
#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

namespace coglab_rt {

/// Joint-space vector in the order of the arm, from base to flange; see JointLimits::names.
using Vector7 = Eigen::Matrix<double, 7, 1>;
/// Force (N) and torque (Nm): Fx Fy Fz Tx Ty Tz.
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Reason why motion is not allowed; `describe()` returns its text.
enum class MotionBlock : std::uint8_t {
  None,          ///< motion is allowed
  Disconnected,  ///< no measurement within the arm's time limit
  Monitor,       ///< the robot controller only measures; it has not been started
  NoPower,       ///< not all drives are powered
  NotStarted,    ///< no `start` since the last stop or fall-back
  Held,          ///< `hold` is latched until `reset`
  Stopping,      ///< `stop` was requested; the arm brakes or waits for monitor mode
  Leashed,       ///< the set-point was too far ahead of the arm; it returns, and the motion must be
                 ///< requested again
  PoorQuality,   ///< the controller rated the connection as unacceptable; stopped until `start`
  DriveError     ///< a drive reported an error, with or without power; stopped until `start`
};

/// Cause of a MotionBlock in words; `nextEvent()` ends it.
inline const char* describe(MotionBlock block) {
  switch (block) {
    case MotionBlock::None:
      return "";
    case MotionBlock::Disconnected:
      return "no measurements from the robot controller; check its network cable and whether its "
             "FRI program runs";
    case MotionBlock::Monitor:
      return "the robot controller is in monitor mode";
    case MotionBlock::NoPower:
      return "not all drives have power; check enabling switch and emergency stop";
    case MotionBlock::NotStarted:
      return "command mode without an explicit start";
    case MotionBlock::Held:
      return "hold is latched";
    case MotionBlock::Stopping:
      return "stop was requested";
    case MotionBlock::Leashed:
      return "the set-point was too far ahead of a blocked arm; request the motion again";
    case MotionBlock::PoorQuality:
      return "the robot controller judged the connection unacceptable: answers were missing or "
             "late; look at answer rate and latency on /diagnostics, relieve this computer or its "
             "network";
    case MotionBlock::DriveError:
      return "a drive reported an error; read its message on the pendant, remove the cause, "
             "acknowledge it there";
  }
  return "?";
}

/// The event of lwr/command that ends the block when its cause is gone, such as "start"; empty if
/// there is none.
inline const char* nextEvent(MotionBlock block) {
  switch (block) {
    case MotionBlock::Monitor:
    case MotionBlock::NoPower:
    case MotionBlock::NotStarted:
    case MotionBlock::PoorQuality:
    case MotionBlock::DriveError:
      return "start";
    case MotionBlock::Held:
      return "reset";
    default:
      return "";
  }
}

/// What to do about the block, for the end of a sentence; empty if no event ends it.
inline std::string advice(MotionBlock block) {
  const std::string event = nextEvent(block);
  return event.empty() ? "" : "; send " + event + " to lwr/command";
}

/// Data of one measurement for the controllers.
struct RobotSample {
  std::uint64_t sequence =
      0;  ///< number of measurements since the arm's interface started; 0: none yet
  std::int64_t stamp_ns = 0;  ///< time of receipt, steady clock (lockstep: simulated time), ns
  double cycle_time = 0.0;    ///< period of the measurements, s
  std::int64_t controller_ns =
      0;  ///< time by the robot controller's counter, including lost cycles, ns; differences are
          ///< the true dt (a silence that ended the session counts as one cycle)
  Vector7 position = Vector7::Zero();         ///< measured, rad
  Vector7 velocity = Vector7::Zero();         ///< from the velocity filter, rad/s
  Vector7 torque = Vector7::Zero();           ///< measured, Nm
  Vector7 external_torque = Vector7::Zero();  ///< estimated by the robot controller, Nm
  Vector6 tool_wrench = Vector6::Zero();  ///< estimated by the robot controller, about the origin
                                          ///< of the tool frame, in its axes
  Vector7 commanded_position = Vector7::Zero();      ///< set-point of the arm, rad
  Vector7 commanded_velocity = Vector7::Zero();      ///< of that set-point, rad/s
  Vector7 commanded_acceleration = Vector7::Zero();  ///< of that set-point, rad/s^2
  MotionBlock block = MotionBlock::Disconnected;     ///< None: target velocities are followed
  std::int8_t blocking_joint = -1;  ///< Leashed: index of the joint that was too far ahead, else -1
  std::uint32_t motion_epoch =
      0;  ///< increases whenever motion is blocked or allowed again: abort the current motion
  /// Distance that the arm's own guard keeps from a joint's stop in addition to the margin of
  /// JointLimits: the displacement during stop_delay (s) at constant speed, plus stop_rounding
  /// (rad). Planners of motions keep the same distance.
  double stop_delay = 0.0, stop_rounding = 0.0;
};

/// A target velocity of the control thread.
struct VelocityCommand {
  Vector7 velocity = Vector7::Zero();  ///< rad/s
  std::int64_t stamp_ns = 0;           ///< steady clock (lockstep: simulated time); 0: no command
  std::uint32_t motion_epoch =
      0;  ///< epoch of the sample from which it was computed; older epochs are ignored
};

}  // namespace coglab_rt
