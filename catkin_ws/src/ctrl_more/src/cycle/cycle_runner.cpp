#include "cycle/cycle_runner.hpp"

#include <utility>

#include "cycle/controller_slot.hpp"
#include "cycle/steady_now.hpp"

namespace ctrl_more {

CycleRunner::CycleRunner(RobotStates& robot, ControlStates& control, const ManagerOptions& options,
                         Logger* logger)
    : robot_(robot),
      control_(control),
      options_(options),
      log_(logger, "FeedbackControllersManager", &number_),
      original_(0, control.controlPeriod(), logger) {}

void CycleRunner::freeze() {
  if (laid_out_ && original_.dataSize() == control_.dataSize()) return;
  robot_.freeze();
  control_.freeze();
  original_ = control_;
  compared_.assign(control_.dataSize(), 0.0);
  laid_out_ = true;
}

void CycleRunner::begin(const Cycle& cycle) noexcept {
  cycle_ = cycle;
  buffer_ = records_.begin();
  number_.store(cycle.number, std::memory_order_relaxed);
  // The stores may have been fixed by another manager, or by the host.
  freeze();
  adopt(plans_.take());
}

void CycleRunner::adoptPrepared() noexcept {
  const Plan* first = plans_.takePrepared();
  if (!first) return;
  // An older one may have been offered since begin(): it must not come afterwards.
  const Plan* second = plans_.take();
  if (second && second->generation < first->generation) std::swap(first, second);
  adopt(first);
  adopt(second);
}

void CycleRunner::adopt(const Plan* plan) noexcept {
  if (!plan) return;
  plan_ = plan;
  for (const PlanEntry& entry : plan->entries) entry.slot->adopt(entry);
  plans_.acknowledge(*plan);
}

void CycleRunner::runStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept {
  if (!plan_ || plan_->stages[static_cast<int>(stage)].empty()) return;
  if (control.dataSize() != original_.dataSize()) {
    CTRL_MORE_LOG(log_, Error, "control states of {} numbers were given, {} expected: nothing run",
                  control.dataSize(), original_.dataSize());
    return;
  }
  original_.copyValuesFrom(control);
  recorded_ = true;
  StageRun run{cycle_,
               robot,
               original_,
               control,
               options_.check_undeclared ? &compared_ : nullptr,
               options_.timed || plan_->timed,
               buffer_,
               0};
  if (run.timed) run.boundary_ns = steadyNow();
  for (ControllerSlot* slot : plan_->stages[static_cast<int>(stage)]) slot->run(run);
}

void CycleRunner::end() noexcept {
  if (recorded_) recorded_cycle_[buffer_] = cycle_.number;
  records_.end(recorded_);
  recorded_ = false;
}

unsigned CycleRunner::acquireRecords(std::uint64_t& cycle) {
  const unsigned buffer = records_.acquire();
  cycle = recorded_cycle_[buffer];
  return buffer;
}

}  // namespace ctrl_more
