/// @file
/// How requests reach the control cycle: immutable plans, adopted between two cycles.
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

/// What became of an offered plan.
enum class PlanOutcome : std::uint8_t {
  Adopted,    ///< the cycle acknowledged it
  Withdrawn,  ///< the cycle did not take it in time; it was taken back and never had an effect
  Taken       ///< the cycle took it but did not acknowledge in time: it is, or will be, in effect
};

/// Hands plans from the threads that build them to the one control thread.
///
/// Builders (services) come one after another. Each offers a plan by one atomic pointer; the cycle
/// takes it at its start, acknowledges its number, and never looks at the one before again; the
/// builder then frees the old one. So the cycle neither locks nor frees, and what it reads is never
/// changed under it (docs/architecture.md, step 3).
///
/// @tparam Plan what is handed over; the cycle may write fields of it that the builder reads after
/// Adopted
template <typename Plan>
class PlanExchange {
 public:
  /// Called again and again while a builder waits. Default: sleep 0.2 ms. Where nobody else runs
  /// the cycle (lockstep, tests), set it to a function that adopts.
  using Wait = std::function<void()>;

  PlanExchange() = default;
  PlanExchange(const PlanExchange&) = delete;
  PlanExchange& operator=(const PlanExchange&) = delete;

  /// Replaces the way of waiting (before any plan is offered).
  void setWait(Wait wait) {
    const std::lock_guard<std::mutex> lock(building_);
    wait_ = std::move(wait);
  }

  /// Offers a plan and waits for its acknowledgement, at most `timeout_s` seconds on the steady
  /// clock.
  /// @param read called with the plan as the cycle left it, if the outcome is Adopted
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

  /// As above, for plans that bring nothing back.
  PlanOutcome offer(std::unique_ptr<Plan> plan, double timeout_s) {
    return offer(std::move(plan), timeout_s, [](const Plan&) {});
  }

  /// Control thread: takes the newest plan if there is one, else returns null. The plan stays valid
  /// until the one after it is adopted. Call acknowledge() when the one before is no longer used.
  Plan* take() {
    Offer* const offer = offered_.exchange(nullptr, std::memory_order_acq_rel);
    if (offer == nullptr) return nullptr;
    taken_number_ = offer->number;
    return offer->plan.get();
  }

  /// Control thread: the plan from take() is in effect, and its fields are final.
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
    unconfirmed_.clear();  // all of them are older than what the cycle acknowledged
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
