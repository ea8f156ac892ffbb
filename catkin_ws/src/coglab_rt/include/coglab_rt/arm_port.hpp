/// @file
/// The port of an arm: what every back end (a real arm, an ideal one, or another) offers to the
/// controller manager in the same process.
///
/// Threads. The *main* thread starts and ends the arm. The *arm's* thread writes one RobotSample
/// per measurement, wakes the control thread, and takes the newest VelocityCommand. The *control*
/// thread reads the newest sample and writes one command. Neither of the two waits for the other,
/// locks or allocates.
#pragma once

#include <functional>

#include "coglab_rt/robot_sample.hpp"
#include "coglab_rt/triple_buffer.hpp"

namespace coglab_rt {

/// The two mailboxes between an arm's thread and the control thread; one of each at a time. All
/// four functions are wait-free.
class ArmMailboxes {
 public:
  /// Arm's thread: the newest measurement, with the permission to move.
  void publishSample(const RobotSample& sample) { samples_.write(sample); }
  /// Arm's thread: the newest command; returns whether it is newer than the last one taken. The arm
  /// judges its age and its epoch, and brakes when none is in force.
  bool takeVelocity(VelocityCommand& command) { return velocities_.read(command); }

  /// Control thread: the newest sample; returns whether it is newer than the last one read.
  bool newestSample(RobotSample& sample) { return samples_.read(sample); }
  /// Control thread: the velocity from now on.
  void sendVelocity(const VelocityCommand& command) { velocities_.write(command); }

 private:
  TripleBuffer<RobotSample> samples_;
  TripleBuffer<VelocityCommand> velocities_;
};

/// A back end. Three functions make one, beside its mailboxes.
class ArmPort {
 public:
  /// What the arm's thread calls after each sample (true), and from time to time while there is
  /// none (false). Real-time safe, never throws.
  using Wake = std::function<void(bool measured)>;

  virtual ~ArmPort() = default;

  /// Any thread; the same object as long as the arm lives.
  virtual ArmMailboxes& mailboxes() = 0;

  /// Main thread, once: from now on samples come and `wake` is called. All or nothing: when it
  /// throws, no thread runs and `wake` is called no more.
  /// @throws std::exception naming what cannot be had, what was expected, what to do next
  virtual void start(Wake wake) = 0;

  /// Any thread that serves requests, never the arm's or the control thread: whether the commands
  /// in the mailbox count (true), or only what comes over the topic target_joint_states (false, as
  /// long as no controller was active).
  virtual void setControllerActive(bool active) = 0;

  /// Main thread: brakes within the limits, while commands may still come, then ends the arm's
  /// thread; `wake` is called no more. Bounded in time, needs no ROS master. Safe to call twice.
  virtual void shutdown() = 0;

  /// Main thread, after shutdown(): says goodbye to the ROS master, for which it may have to wait.
  virtual void unregister() {}

  /// After start(): highest SCHED_FIFO priority of threads that must not delay the arm's; 0: none.
  virtual int highestPriority() { return 99; }
};

}  // namespace coglab_rt
