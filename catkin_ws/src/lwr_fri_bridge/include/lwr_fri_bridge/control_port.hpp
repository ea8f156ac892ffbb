/// @file
/// The border between the FRI thread and whoever computes joint velocities (design: processes and
/// threads).
///
/// The bridge writes one RobotSample per FRI measurement; the control thread reads the newest one
/// and writes one velocity command. Both directions are wait-free and never allocate, so that
/// neither thread can delay the other.
#pragma once

#include <atomic>
#include <cstdint>

#include <Eigen/Core>

namespace lwr_fri_bridge {

/// Joint-space vector in wire order: A1, A2, E1, A3, A4, A5, A6.
using Vector7 = Eigen::Matrix<double, 7, 1>;
/// Force (N) and torque (Nm): Fx Fy Fz Tx Ty Tz (the wire's reversed torque order is already
/// undone).
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Why motion is not allowed at the moment; the words are in `describe()`.
enum class MotionBlock : std::uint8_t {
  None,          ///< motion is allowed
  Disconnected,  ///< no datagram within the receive time limit
  Monitor,       ///< the controller is in monitor mode
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
const char* describe(MotionBlock block);

/// What one FRI measurement tells the controllers.
struct RobotSample {
  std::uint64_t sequence =
      0;  ///< number of measurements accepted since the bridge started; 0: none yet
  std::int64_t stamp_ns = 0;  ///< time of receipt, steady clock (lockstep: simulated time), ns
  double cycle_time = 0.0;    ///< FRI period, s
  std::int64_t controller_ns =
      0;  ///< time by the controller's counter since the bridge started, lost cycles included, ns;
          ///< differences are the true dt (silence that ended the session counts one cycle)
  Vector7 position = Vector7::Zero();         ///< measured, rad
  Vector7 velocity = Vector7::Zero();         ///< from the velocity filter, rad/s
  Vector7 torque = Vector7::Zero();           ///< measured, Nm
  Vector7 external_torque = Vector7::Zero();  ///< estimated by the robot controller, Nm
  Vector6 tool_wrench = Vector6::Zero();  ///< estimated by the robot controller, about the tool's
                                          ///< origin in the tool's axes, see toolWrench()
  Vector7 commanded_position = Vector7::Zero();      ///< sent in the last answer, rad
  Vector7 commanded_velocity = Vector7::Zero();      ///< state of the interpolator, rad/s
  Vector7 commanded_acceleration = Vector7::Zero();  ///< state of the interpolator, rad/s^2
  MotionBlock block = MotionBlock::Disconnected;     ///< None: target velocities are followed
  std::int8_t blocking_joint = -1;  ///< Leashed: index of the joint that ran ahead, else -1
  std::uint32_t motion_epoch =
      0;  ///< grows whenever motion is blocked or allowed again: abort what is running
};

/// A target velocity of the control thread.
struct VelocityCommand {
  Vector7 velocity = Vector7::Zero();  ///< rad/s
  std::int64_t stamp_ns = 0;           ///< steady clock (lockstep: simulated time); 0: no command
  std::uint32_t motion_epoch =
      0;  ///< epoch of the sample it was computed from; older ones are ignored
};

/// A value that one thread writes and one thread reads, both wait-free: three slots, the newest
/// complete one wins.
template <typename T>
class TripleBuffer {
 public:
  /// Publishes a value (writer thread only).
  void write(const T& value) {
    slots_[write_] = value;
    write_ =
        middle_.exchange(static_cast<std::uint8_t>(write_ | kFresh), std::memory_order_acq_rel) &
        kIndex;
  }

  /// Copies the newest value (reader thread only). Returns whether it is newer than the last one
  /// read.
  bool read(T& value) {
    const bool fresh = (middle_.load(std::memory_order_relaxed) & kFresh) != 0;
    if (fresh) read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    value = slots_[read_];
    return fresh;
  }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  T slots_[3];
  std::uint8_t write_ = 0, read_ = 1;
  std::atomic<std::uint8_t> middle_{2};
};

/// The two mailboxes. One FRI thread and one control thread use it at a time.
class ControlPort {
 public:
  // FRI thread
  void publishSample(const RobotSample& sample) { samples_.write(sample); }
  bool takeVelocity(VelocityCommand& command) { return velocities_.read(command); }
  // control thread
  bool newestSample(RobotSample& sample) { return samples_.read(sample); }
  void sendVelocity(const VelocityCommand& command) { velocities_.write(command); }

 private:
  TripleBuffer<RobotSample> samples_;
  TripleBuffer<VelocityCommand> velocities_;
};

}  // namespace lwr_fri_bridge
