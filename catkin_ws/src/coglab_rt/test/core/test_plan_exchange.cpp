/// Plans for the control cycle: their outcomes, and when they are freed.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>

#include "coglab_rt/plan_exchange.hpp"

namespace coglab_rt {
namespace {

std::atomic<int> alive{0};

struct Plan {
  explicit Plan(int number) : number(number) { ++alive; }
  ~Plan() {
    number = -1;
    --alive;
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  int number;
  int answer = 0;
};

TEST(PlanExchange, AnUntakenPlanIsWithdrawnAndHasNoEffect) {
  PlanExchange<Plan> plans;
  EXPECT_EQ(plans.offer(std::make_unique<Plan>(1), 0.01), PlanOutcome::Withdrawn);
  EXPECT_EQ(plans.take(), nullptr);
  EXPECT_EQ(plans.generation(), 0U);
  EXPECT_EQ(alive, 0);
}

TEST(PlanExchange, APlanThatIsTakenTooLateStaysValidUntilTheNextOne) {
  PlanExchange<Plan> plans;
  Plan* taken = nullptr;
  plans.setWait([&] { taken = taken != nullptr ? taken : plans.take(); });
  EXPECT_EQ(plans.offer(std::make_unique<Plan>(7), 0.01), PlanOutcome::Taken);
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(taken->number, 7);
  plans.acknowledge();
  EXPECT_EQ(plans.generation(), 1U);
}

TEST(PlanExchange, WithAThreadThatTakesThemEachComesOnceAndInOrder) {
  constexpr int kPlans = 300;
  {
    PlanExchange<Plan> plans;
    std::atomic<bool> over{false};
    bool valid = true, ordered = true;
    int last = 0;
    std::thread cycle([&] {
      const Plan* in_effect = nullptr;
      while (!over) {
        if (in_effect != nullptr) valid = valid && in_effect->number == last;
        if (Plan* next = plans.take()) {
          ordered = ordered && next->number == last + 1;
          last = next->number;
          next->answer = 2 * next->number;
          in_effect = next;
          plans.acknowledge();
        }
        std::this_thread::yield();
      }
    });
    for (int i = 1; i <= kPlans; ++i) {
      int answer = 0;
      ASSERT_EQ(plans.offer(std::make_unique<Plan>(i), 10.0,
                            [&answer](const Plan& plan) { answer = plan.answer; }),
                PlanOutcome::Adopted);
      ASSERT_EQ(answer, 2 * i);
      ASSERT_LE(alive, 2);
    }
    over = true;
    cycle.join();
    EXPECT_TRUE(valid);
    EXPECT_TRUE(ordered);
    EXPECT_EQ(plans.generation(), static_cast<std::uint64_t>(kPlans));
  }
  EXPECT_EQ(alive, 0);
}

TEST(PlanExchange, APlanThatWasTakenLateIsFreedByTheNextOneThatIsAdopted) {
  {
    PlanExchange<Plan> plans;
    bool late = true;
    plans.setWait([&] {
      if (plans.take() != nullptr && !late) plans.acknowledge();
    });
    EXPECT_EQ(plans.offer(std::make_unique<Plan>(1), 0.01), PlanOutcome::Taken);
    EXPECT_EQ(alive, 1);
    late = false;
    EXPECT_EQ(plans.offer(std::make_unique<Plan>(2), 10.0), PlanOutcome::Adopted);
    EXPECT_EQ(plans.generation(), 2U);
    EXPECT_EQ(alive, 1);
  }
  EXPECT_EQ(alive, 0);
}

}  // namespace
}  // namespace coglab_rt
