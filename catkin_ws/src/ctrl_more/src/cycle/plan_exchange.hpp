#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>

#include "cycle/plan.hpp"

namespace ctrl_more {

/// Hands plans from the services to the cycle: the newest is taken with one atomic exchange at the
/// start of a cycle, and acknowledged by its generation. What the cycle has left behind is freed
/// by the services.
///
/// store() to collect() are for services, one at a time; take() to acknowledge() for the cycle.
class PlanExchange {
 public:
  ~PlanExchange();

  /// Number of the newest plan that was offered.
  std::uint64_t generation() const { return generation_; }
  /// Keeps a plan that is to be offered next; its generation must be generation() + 1.
  void store(std::unique_ptr<const Plan> plan) { plans_.push_back(std::move(plan)); }
  /// Offers the stored plan to the cycle, in place of what the cycle has not taken.
  /// @param prepared true: the cycle takes it only by takePrepared()
  void offer(bool prepared) noexcept;
  /// Takes back the newest offered plan, and keeps the stored one to be offered instead.
  /// @return false if the cycle has taken it; the stored one is dropped then
  bool retract() noexcept;
  /// Waits until the cycle has acknowledged a plan.
  /// @param generation of the plan
  /// @param timeout_s longest wait [s]
  bool wait(std::uint64_t generation, double timeout_s) const;
  /// Frees the plans that the cycle has left behind.
  void collect();

  /// The newest ordinary plan, null if there is nothing new.
  const Plan* take() noexcept;
  /// The newest prepared plan, null if there is none.
  const Plan* takePrepared() noexcept;
  /// The cycle uses this plan from now on.
  void acknowledge(const Plan& plan) noexcept {
    acknowledged_.store(plan.generation, std::memory_order_release);
  }

 private:
  void forget(const Plan* untaken);

  std::uint64_t generation_ = 0;
  std::deque<std::unique_ptr<const Plan>> plans_;  // what the cycle has or may still have

  // shared
  std::atomic<const Plan*> offered_{nullptr};
  std::atomic<const Plan*> prepared_{nullptr};
  std::atomic<std::uint64_t> acknowledged_{0};
};

}  // namespace ctrl_more
