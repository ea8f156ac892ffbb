/// @file
/// The thread that runs the control cycle. Arriving measurements wake it (docs/architecture.md,
/// processes and threads).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include <semaphore.h>

#include "coglab_controllers/manager/control_cycle.hpp"
#include "coglab_rt/real_time.hpp"

namespace coglab_controllers {

/// Settings of the thread.
struct ControlThreadOptions {
  int priority = 70;          ///< SCHED_FIFO, below the arm's thread; 0: scheduling unchanged
  double idle_period = 0.02;  ///< s, period of idle cycles without measurements
  std::size_t stack_bytes = 1024 * 1024;
  /// Called in this thread after each cycle with a command, for a robot behind a topic. Not
  /// real-time.
  std::function<void(const VelocityCommand&)> after_cycle;
};

/// Reads the newest sample from the arm's mailboxes, runs the cycle and writes the velocity back.
///
/// The period is the smallest whole number of measurement periods that is not shorter than
/// cycle_time. Without measurements, idle cycles run, so that controllers can load before the robot
/// is connected.
class ControlThread {
 public:
  ControlThread(ControlCycle& cycle, coglab_rt::ArmMailboxes& mailboxes,
                ControlThreadOptions options = {});
  ~ControlThread();
  ControlThread(const ControlThread&) = delete;
  ControlThread& operator=(const ControlThread&) = delete;

  void start();
  /// Ends the thread after the running cycle.
  void stop();

  /// Wakes the cycle when its period is over. The thread that writes samples calls it after each
  /// sample. Wait-free.
  void wake(bool answered) noexcept;

  /// Warning about scheduling; empty if there is none or the thread has not set it yet.
  std::string warning() const;

 private:
  void run();
  void once(bool woken);

  ControlCycle& cycle_;
  coglab_rt::ArmMailboxes& mailboxes_;
  ControlThreadOptions options_;
  sem_t semaphore_;
  coglab_rt::BoundedThread thread_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> periods_{1};      // measurement periods per cycle
  int since_wake_ = 0;               // writer's thread
  std::uint64_t last_sequence_ = 0;  // control thread
  std::int64_t last_controller_ns_ = 0;
  std::string warning_;  // written before scheduled_
  std::atomic<bool> scheduled_{false};
};

}  // namespace coglab_controllers
