#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "ctrl_more/description/configuration.hpp"
#include "ctrl_more/states/cycle.hpp"

namespace ctrl_more {

class Slot;

/// What one controller is to do from the cycle that adopts the plan. Counters show the slot what
/// is new, so that a plan which replaces an unread one loses nothing.
struct PlanEntry {
  std::shared_ptr<Slot> slot;  ///< keeps the instance and its library alive
  bool enabled = false;
  bool paused = false;
  std::uint32_t fault_clears = 0;  ///< faults up to here are forgiven
  std::uint32_t resets = 0;        ///< how often reset() was requested
  std::uint32_t reorders = 0;      ///< how often its place in the order changed
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// Everything a manager is to do, immutable; see FeedbackControllersManager.
struct Plan {
  std::uint64_t generation = 0;
  bool timed = false;                                ///< some controller's duration is judged
  std::vector<PlanEntry> entries;                    ///< execution order
  std::array<std::vector<Slot*>, kStages> stages{};  ///< the same, per stage
};

/// Hands plans from the services to the cycle. The cycle takes the newest by one atomic exchange at
/// its start, and acknowledges its generation. The services free what the cycle has left behind.
/// Unlike coglab_rt::PlanExchange, offering does not wait for the cycle, a newer plan replaces one
/// that was not taken, and a plan can be prepared for a later point of the cycle.
///
/// store() to collect() are for services, one at a time; take() to acknowledge() for the cycle.
class PlanQueue {
 public:
  /// Number of the newest plan that was offered.
  std::uint64_t generation() const { return generation_; }

  /// Keeps a plan that is to be offered next; its generation must be generation() + 1.
  void store(std::unique_ptr<const Plan> plan) { plans_.push_back(std::move(plan)); }

  /// Offers the stored plan to the cycle, in place of what the cycle has not taken.
  /// @param prepared true: the cycle takes it only by takePrepared()
  void offer(bool prepared) noexcept {
    const Plan* const plan = plans_.back().get();
    generation_ = plan->generation;
    // A plan says everything, what was prepared before included.
    forget(prepared_.exchange(prepared ? plan : nullptr, std::memory_order_acq_rel));
    if (!prepared) forget(offered_.exchange(plan, std::memory_order_acq_rel));
    collect();
  }

  /// Takes back the newest offered plan, and keeps the stored one to be offered instead.
  /// @return false if the cycle has taken it; the stored one is dropped then
  bool retract() noexcept {
    const Plan* const newest = plans_.size() < 2 ? nullptr : plans_[plans_.size() - 2].get();
    const auto takeBack = [newest](std::atomic<const Plan*>& place) {
      const Plan* offer = newest;
      return place.compare_exchange_strong(offer, nullptr, std::memory_order_acq_rel);
    };
    if (!newest || (!takeBack(offered_) && !takeBack(prepared_))) {
      plans_.pop_back();
      return false;
    }
    forget(newest);
    return true;
  }

  /// Waits until the cycle has acknowledged a plan, at most `timeout_s`.
  bool wait(std::uint64_t generation, double timeout_s) const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
    while (acknowledged_.load(std::memory_order_acquire) < generation) {
      if (std::chrono::steady_clock::now() >= end) return false;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    return true;
  }

  /// Frees the plans that the cycle has left behind.
  void collect() {
    const std::uint64_t in_use = acknowledged_.load(std::memory_order_acquire);
    while (!plans_.empty() && plans_.front()->generation < in_use) plans_.pop_front();
  }

  /// The newest ordinary plan, null if there is nothing new.
  const Plan* take() noexcept { return takeFrom(offered_); }
  /// The newest prepared plan, null if there is none.
  const Plan* takePrepared() noexcept { return takeFrom(prepared_); }
  /// The cycle uses this plan from now on.
  void acknowledge(const Plan& plan) noexcept {
    acknowledged_.store(plan.generation, std::memory_order_release);
  }

 private:
  static const Plan* takeFrom(std::atomic<const Plan*>& place) noexcept {
    if (place.load(std::memory_order_relaxed) == nullptr) return nullptr;
    return place.exchange(nullptr, std::memory_order_acq_rel);
  }

  // Frees a plan that the cycle never saw, and never will.
  void forget(const Plan* untaken) {
    if (!untaken) return;
    for (auto it = plans_.begin(); it != plans_.end(); ++it) {
      if (it->get() != untaken) continue;
      plans_.erase(it);
      break;
    }
  }

  std::uint64_t generation_ = 0;
  std::deque<std::unique_ptr<const Plan>> plans_;  // what the cycle has or may still have

  // shared
  std::atomic<const Plan*> offered_{nullptr};
  std::atomic<const Plan*> prepared_{nullptr};
  std::atomic<std::uint64_t> acknowledged_{0};
};

}  // namespace ctrl_more
