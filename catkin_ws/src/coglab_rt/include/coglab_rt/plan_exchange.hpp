/// @file
/// Passes requests to the control cycle as immutable plans, adopted between two cycles.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace coglab_rt {

/// Result of an offered plan.
enum class PlanOutcome : std::uint8_t {
  Adopted,    ///< the cycle acknowledged it
  Withdrawn,  ///< the cycle did not take it in time; it was withdrawn and had no effect
  Taken       ///< the cycle took it but did not acknowledge in time: it is or will be in effect
};

/// Passes plans from the threads that build them to the control thread.
///
/// Builders (services) take turns. Each offers a plan through an atomic pointer. The cycle takes
/// the plan at its start, acknowledges its number, and does not access the previous plan any more.
/// Then the builder frees the previous plan. So the cycle neither locks nor frees, and the data
/// that it reads is never changed (docs/architecture.md, step 3).
///
/// @tparam Plan type of the plans; the cycle may write fields of a plan that the builder reads
/// after Adopted
template <typename Plan>
class PlanExchange {
 public:
  /// Called repeatedly while a builder waits. Default: sleep 0.2 ms. If no other thread runs the
  /// cycle (lockstep, tests), set it to a function that adopts the plan.
  using Wait = std::function<void()>;

  PlanExchange() = default;
  PlanExchange(const PlanExchange&) = delete;
  PlanExchange& operator=(const PlanExchange&) = delete;

  /// Replaces the waiting function. Call it before any plan is offered.
  void setWait(Wait wait) {
    const std::lock_guard<std::mutex> lock(building_);
    wait_ = std::move(wait);
  }

  /// Offers a plan and waits for its acknowledgement, at most `timeout_s` (s, steady clock).
  /// @param read called with the plan after the cycle has written to it, if the outcome is Adopted
  template <typename Read>
  PlanOutcome offer(std::unique_ptr<Plan> plan, double timeout_s, Read&& read) {
    const std::lock_guard<std::mutex> lock(building_);
    Plan* const raw = plan.get();
    const std::uint64_t number = ++offered_number_;
    Offer* const offer = new Offer{std::move(plan), number};
    offered_.store(offer, std::memory_order_release);
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
    do {
      if (wait_) {
        wait_();
      } else {
        std::this_thread::sleep_for(std::chrono::microseconds(200));
      }
      if (adopted_number_.load(std::memory_order_acquire) >= number) {
        read(static_cast<const Plan&>(*raw));
        retire(offer);
        return PlanOutcome::Adopted;
      }
    } while (std::chrono::steady_clock::now() < end);
    if (offered_.exchange(nullptr, std::memory_order_acq_rel) == offer) {
      delete offer;
      return PlanOutcome::Withdrawn;
    }
    unconfirmed_.push_back(std::unique_ptr<Offer>(offer));
    return PlanOutcome::Taken;
  }

  /// The same for plans from which nothing is read.
  PlanOutcome offer(std::unique_ptr<Plan> plan, double timeout_s) {
    return offer(std::move(plan), timeout_s, [](const Plan&) {});
  }

  /// Control thread: takes the newest plan; null if there is none. The plan is valid until the next
  /// one is adopted. Call acknowledge() when the previous plan is not used any more.
  Plan* take() {
    Offer* const offer = offered_.exchange(nullptr, std::memory_order_acq_rel);
    if (offer == nullptr) return nullptr;
    taken_number_ = offer->number;
    return offer->plan.get();
  }

  /// Control thread: declares that the plan from take() is in effect and its fields are final.
  void acknowledge() { adopted_number_.store(taken_number_, std::memory_order_release); }

  /// Number of the newest acknowledged plan; 0 before the first.
  std::uint64_t generation() const { return adopted_number_.load(std::memory_order_acquire); }

 private:
  struct Offer {
    std::unique_ptr<Plan> plan;
    std::uint64_t number;
  };

  void retire(Offer* now_in_effect) {
    in_effect_.reset(now_in_effect);
    unconfirmed_.clear();  // all of them are older than the acknowledged plan
  }

  std::mutex building_;
  Wait wait_;
  std::uint64_t offered_number_ = 0;
  std::unique_ptr<Offer> in_effect_;
  std::vector<std::unique_ptr<Offer>> unconfirmed_;
  std::atomic<Offer*> offered_{nullptr};
  std::atomic<std::uint64_t> adopted_number_{0};
  std::uint64_t taken_number_ = 0;  // control thread only
};

}  // namespace coglab_rt
