#include "cycle/plan_exchange.hpp"

#include <chrono>
#include <thread>

namespace ctrl_more {

PlanExchange::~PlanExchange() = default;

void PlanExchange::offer(bool prepared) noexcept {
  const Plan* const plan = plans_.back().get();
  generation_ = plan->generation;
  // A plan is the whole truth, what was prepared before included.
  forget(prepared_.exchange(prepared ? plan : nullptr, std::memory_order_acq_rel));
  if (!prepared) forget(offered_.exchange(plan, std::memory_order_acq_rel));
  collect();
}

bool PlanExchange::retract() noexcept {
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

// Frees a plan that the cycle never saw, and never will.
void PlanExchange::forget(const Plan* untaken) {
  if (!untaken) return;
  for (auto it = plans_.begin(); it != plans_.end(); ++it) {
    if (it->get() != untaken) continue;
    plans_.erase(it);
    break;
  }
}

void PlanExchange::collect() {
  const std::uint64_t in_use = acknowledged_.load(std::memory_order_acquire);
  while (!plans_.empty() && plans_.front()->generation < in_use) plans_.pop_front();
}

bool PlanExchange::wait(std::uint64_t generation, double timeout_s) const {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  while (acknowledged_.load(std::memory_order_acquire) < generation) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  return true;
}

const Plan* PlanExchange::take() noexcept {
  if (offered_.load(std::memory_order_relaxed) == nullptr) return nullptr;
  return offered_.exchange(nullptr, std::memory_order_acq_rel);
}

const Plan* PlanExchange::takePrepared() noexcept {
  if (prepared_.load(std::memory_order_relaxed) == nullptr) return nullptr;
  return prepared_.exchange(nullptr, std::memory_order_acq_rel);
}

}  // namespace ctrl_more
