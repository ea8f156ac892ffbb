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

/// Requested state of one controller from the cycle that adopts the plan. Counters show the slot
/// which requests are new. A plan that replaces an unread one therefore loses no request.
struct PlanEntry {
  std::shared_ptr<Slot> slot;  ///< keeps the instance and its library alive
  bool enabled = false;
  bool paused = false;
  std::uint32_t fault_clears = 0;  ///< number of requests to clear the fault
  std::uint32_t resets = 0;        ///< number of requests to reset()
  std::uint32_t reorders = 0;      ///< number of changes of its place in the order
  std::uint32_t gains_revision = 0;
  std::shared_ptr<const GainValues> gains;
};

/// Requested state of all controllers of a manager. Immutable; see FeedbackControllersManager.
struct Plan {
  std::uint64_t generation = 0;
  bool timed = false;              ///< the duration of at least one controller is checked
  std::vector<PlanEntry> entries;  ///< execution order
  std::array<std::vector<Slot*>, kStages> stages{};  ///< the same, per stage
};

/// Transfers plans from the services to the cycle. The cycle takes the newest plan by one atomic
/// exchange at its start and acknowledges its generation. The services free plans that the cycle no
/// longer uses. Differences to coglab_rt::PlanExchange: offering does not wait for the cycle, a
/// newer plan replaces one that was not taken, and a plan can be prepared for a later point of the
/// cycle.
///
/// Services call store() to collect(), one at a time. The cycle calls take() to acknowledge().
class PlanQueue {
 public:
  /// Number of the newest plan that was offered.
  std::uint64_t generation() const { return generation_; }

  /// Stores the plan to offer next. Its generation must be generation() + 1.
  void store(std::unique_ptr<const Plan> plan) { plans_.push_back(std::move(plan)); }

  /// Offers the stored plan to the cycle. It replaces a plan that the cycle has not taken.
  /// @param prepared true: the cycle takes it only by takePrepared()
  void offer(bool prepared) noexcept {
    const Plan* const plan = plans_.back().get();
    generation_ = plan->generation;
    // A plan is complete: it includes what was prepared before.
    forget(prepared_.exchange(prepared ? plan : nullptr, std::memory_order_acq_rel));
    if (!prepared) forget(offered_.exchange(plan, std::memory_order_acq_rel));
    collect();
  }

  /// Withdraws the newest offered plan and keeps the stored one to be offered instead.
  /// @return false if the cycle has taken it; the stored plan is then dropped
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

  /// Frees the plans that the cycle no longer uses.
  void collect() {
    const std::uint64_t in_use = acknowledged_.load(std::memory_order_acquire);
    while (!plans_.empty() && plans_.front()->generation < in_use) plans_.pop_front();
  }

  /// The newest ordinary plan; null if there is no new one.
  const Plan* take() noexcept { return takeFrom(offered_); }
  /// The newest prepared plan; null if there is none.
  const Plan* takePrepared() noexcept { return takeFrom(prepared_); }
  /// Acknowledges that the cycle uses this plan from now on.
  void acknowledge(const Plan& plan) noexcept {
    acknowledged_.store(plan.generation, std::memory_order_release);
  }

 private:
  static const Plan* takeFrom(std::atomic<const Plan*>& place) noexcept {
    if (place.load(std::memory_order_relaxed) == nullptr) return nullptr;
    return place.exchange(nullptr, std::memory_order_acq_rel);
  }

  // Frees a plan that the cycle never took and cannot take any more.
  void forget(const Plan* untaken) {
    if (!untaken) return;
    for (auto it = plans_.begin(); it != plans_.end(); ++it) {
      if (it->get() != untaken) continue;
      plans_.erase(it);
      break;
    }
  }

  std::uint64_t generation_ = 0;
  std::deque<std::unique_ptr<const Plan>> plans_;  // plans that the cycle may still use

  // shared
  std::atomic<const Plan*> offered_{nullptr};
  std::atomic<const Plan*> prepared_{nullptr};
  std::atomic<std::uint64_t> acknowledged_{0};
};

}  // namespace ctrl_more
