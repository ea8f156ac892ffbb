/// @file
/// Interface of an arm: every back end (a real arm, an ideal one, or another) offers it to the
/// controller manager in the same process.
///
/// Threads. The *main* thread starts and ends the arm. The *arm's* thread writes one RobotSample
/// per measurement, wakes the control thread, and takes the newest VelocityCommand. The *control*
/// thread reads the newest sample and writes one command. The latter two never wait for each other,
/// never lock and never allocate.
#pragma once

#include <functional>

#include "coglab_rt/robot_sample.hpp"
#include "coglab_rt/triple_buffer.hpp"

namespace coglab_rt {

/// The two mailboxes between an arm's thread and the control thread. At any time one thread of each
/// kind uses them. All four functions are wait-free.
class ArmMailboxes {
 public:
  /// Arm's thread: publishes the newest measurement, with the permission to move.
  void publishSample(const RobotSample& sample) { samples_.write(sample); }
  /// Arm's thread: reads the newest command. Returns true if it is newer than the last one read.
  /// The arm checks age and epoch of the command and brakes if none is valid.
  bool takeVelocity(VelocityCommand& command) { return velocities_.read(command); }

  /// Control thread: reads the newest sample. Returns true if it is newer than the last one read.
  bool newestSample(RobotSample& sample) { return samples_.read(sample); }
  /// Control thread: sets the velocity from now on.
  void sendVelocity(const VelocityCommand& command) { velocities_.write(command); }

 private:
  TripleBuffer<RobotSample> samples_;
  TripleBuffer<VelocityCommand> velocities_;
};

/// A back end. It implements three functions in addition to its mailboxes.
class ArmPort {
 public:
  /// Called by the arm's thread after each sample (true), and periodically while there are no
  /// samples (false). Real-time safe, never throws.
  using Wake = std::function<void(bool measured)>;

  virtual ~ArmPort() = default;

  /// Any thread. Returns the same object during the life of the arm.
  virtual ArmMailboxes& mailboxes() = 0;

  /// Main thread, once: starts the samples and the calls of `wake`. If it throws, no thread runs
  /// and `wake` is not called any more.
  /// @throws std::exception naming the missing resource, the expected value and the next step
  virtual void start(Wake wake) = 0;

  /// Any thread that serves requests, never the arm's or the control thread. With true the arm
  /// follows the commands in the mailbox; with false only those of the topic target_joint_states
  /// (as long as no controller was active).
  virtual void setControllerActive(bool active) = 0;

  /// Main thread: brakes within the limits while commands may still arrive, then ends the arm's
  /// thread; `wake` is not called any more. Its duration is bounded. It needs no ROS master. A
  /// second call has no effect.
  virtual void shutdown() = 0;

  /// Main thread, after shutdown(): unregisters from the ROS master, which may take long.
  virtual void unregister() {}

  /// After start(): highest SCHED_FIFO priority for threads that must not delay the arm's; 0: none.
  virtual int highestPriority() { return 99; }
};

}  // namespace coglab_rt
