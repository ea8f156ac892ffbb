/// @file
/// Ends a motion from outside the control cycle, and distinguishes requests made before the cancel
/// from later ones.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// The cancels of one motion controller, numbered from 1. Services call ask(); the cycle calls
/// take() and confirm(). The cycle never waits.
class MotionCancel {
 public:
  /// Number of the newest cancel; 0: none yet. Any thread.
  std::uint64_t newest() const { return newest_.load(std::memory_order_acquire); }

  /// Requests the end of the running motion. @return number of this cancel
  std::uint64_t ask(const Reason& reason) {
    const std::lock_guard<std::mutex> lock(asking_);
    const std::uint64_t number = newest() + 1;
    orders_.write({number, reason});
    newest_.store(number, std::memory_order_release);
    return number;
  }

  /// True if the cycle has served this cancel or a later one. Any thread.
  bool served(std::uint64_t number) const {
    return served_.load(std::memory_order_acquire) >= number;
  }
  /// True if this cancel, or one served together with it, ended a motion. Any thread, once served.
  bool endedMotion(std::uint64_t number) const {
    return ended_.load(std::memory_order_acquire) >= number;
  }

  /// @name Control thread
  /// @{

  /// Takes the newest cancel; false if it was taken already. @param reason why the motion ends
  bool take(Reason& reason) {
    Order order;
    if (!orders_.read(order)) return false;
    taken_ = order.number;
    reason = order.reason;
    return true;
  }
  /// Number of the cancel taken last. Requests made before it are refused.
  std::uint64_t taken() const { return taken_; }
  void confirm(bool ended_motion) {
    if (ended_motion) ended_.store(taken_, std::memory_order_release);
    served_.store(taken_, std::memory_order_release);
  }
  /// @}

 private:
  struct Order {
    std::uint64_t number = 0;
    Reason reason;
  };

  std::mutex asking_;
  coglab_rt::TripleBuffer<Order> orders_;
  std::atomic<std::uint64_t> newest_{0}, served_{0}, ended_{0};
  std::uint64_t taken_ = 0;  // control thread
};

/// Time of a request. A later cancel or a new motion epoch makes the request void.
struct RequestStamp {
  std::uint64_t cancels = 0;       ///< newest cancel of its controller at that time
  std::uint32_t motion_epoch = 0;  ///< of the joint state that allowed it
};

/// A cancel in progress, see ControllerManager::askCancel().
struct CancelOrder {
  std::shared_ptr<MotionCancel> cancel;  ///< null: no such controller
  std::string id;
  std::uint64_t number = 0;
  std::uint64_t cycles = 0;  ///< CycleReport::cycles at the time of the request
};

/// Answer to a cancel; success: the set-point of the arm is at rest.
struct CancelAnswer : Answer {
  bool was_running = false;  ///< there was a motion to end
};

}  // namespace coglab_controllers
