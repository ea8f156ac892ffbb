#include "ctrl_more/feedback_controllers_manager.hpp"

#include <chrono>
#include <thread>
#include <utility>

#include "manager_members.hpp"
#include "record_exchange.hpp"
#include "steady_now.hpp"

namespace ctrl_more {

FeedbackControllersManager::FeedbackControllersManager(RobotStates& robot, ControlStates& control,
                                                       const ManagerOptions& options,
                                                       Logger* logger)
    : robot_(robot),
      control_(control),
      options_(options),
      logger_(logger ? logger : &Logger::standard()),
      log_(logger_, "FeedbackControllersManager", &cycle_number_),
      records_(std::make_unique<RecordExchange>()),
      original_(0, control.controlPeriod(), logger_) {}

FeedbackControllersManager::~FeedbackControllersManager() {
  offered_.store(nullptr);
  prepared_.store(nullptr);
  for (auto& member : members_) member->slot->setOwner(nullptr);
}

FeedbackControllersManager::Draft FeedbackControllersManager::draftOf() const {
  Draft draft;
  for (const auto& member : members_) draft.states.push_back(member->state);
  draft.order = order_;
  return draft;
}

// The plan of a draft that has as many states as there are members.
std::unique_ptr<Plan> FeedbackControllersManager::planOf(const Draft& draft) const {
  auto plan = std::make_unique<Plan>();
  plan->generation = generation_ + 1;
  for (const std::string& name : draft.order) {
    const int i = indexOf(name);
    const std::shared_ptr<ControllerSlot>& slot = members_[i]->slot;
    const MemberState& state = draft.states[i];
    plan->entries.push_back({slot, state.enabled, !state.reasons.empty(), state.fault_clears,
                             state.resets, state.reorders, state.gains_revision, state.gains});
    plan->stages[static_cast<int>(slot->stage())].push_back(slot.get());
    plan->timed = plan->timed || slot->isTimed();
  }
  return plan;
}

// Makes the draft the truth, and offers it to the cycle as a plan. If memory runs out, nothing has
// changed.
Status FeedbackControllersManager::publish(Draft draft, bool prepared) {
  plans_.push_back(planOf(draft));
  return commit(std::move(draft), prepared);
}

// The part of publish() that cannot fail; the plan is the last of plans_.
Status FeedbackControllersManager::commit(Draft draft, bool prepared) noexcept {
  const Plan* const offer = plans_.back().get();
  generation_ = offer->generation;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    members_[i]->state = std::move(draft.states[i]);
  }
  order_ = std::move(draft.order);
  before_last_.reset();
  // A plan is the whole truth, what was prepared before included.
  forget(prepared_.exchange(prepared ? offer : nullptr, std::memory_order_acq_rel));
  if (!prepared) forget(offered_.exchange(offer, std::memory_order_acq_rel));
  collect();
  return Status::published(generation_);
}

// Frees a plan that the cycle never saw, and never will.
void FeedbackControllersManager::forget(const Plan* untaken) {
  if (!untaken) return;
  for (auto it = plans_.begin(); it != plans_.end(); ++it) {
    if (it->get() != untaken) continue;
    plans_.erase(it);
    break;
  }
}

// Frees the plans that the cycle has left behind.
void FeedbackControllersManager::collect() {
  const std::uint64_t in_use = acknowledged_.load(std::memory_order_acquire);
  while (!plans_.empty() && plans_.front()->generation < in_use) plans_.pop_front();
}

bool FeedbackControllersManager::waitAdopted(std::uint64_t generation, double timeout_s) const {
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  while (acknowledged_.load(std::memory_order_acquire) < generation) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  return true;
}

Status FeedbackControllersManager::withdraw(std::uint64_t generation) {
  const Lock lock(mutex_);
  if (generation != generation_ || !before_last_ ||
      before_last_->states.size() != members_.size()) {
    return Status::failure("plan " + std::to_string(generation) +
                           " cannot be withdrawn: the newest one is " +
                           std::to_string(generation_));
  }
  plans_.push_back(planOf(*before_last_));
  const Plan* const newest = plans_.size() < 2 ? nullptr : plans_[plans_.size() - 2].get();
  const auto takeBack = [newest](std::atomic<const Plan*>& place) {
    const Plan* offer = newest;
    return place.compare_exchange_strong(offer, nullptr, std::memory_order_acq_rel);
  };
  if (!newest || (!takeBack(offered_) && !takeBack(prepared_))) {
    plans_.pop_back();
    return Status::failure("plan " + std::to_string(generation) + " is adopted already");
  }
  forget(newest);
  const std::unique_ptr<Draft> back = std::move(before_last_);
  return commit(std::move(*back), false);
}

void FeedbackControllersManager::freeze() {
  if (laid_out_ && original_.dataSize() == control_.dataSize()) return;
  robot_.freeze();
  control_.freeze();
  original_ = control_;
  signals_ = control_.offsets();
  found_.assign(control_.dataSize(), nullptr);
  compared_.assign(control_.dataSize(), 0.0);
  laid_out_ = true;
}

void FeedbackControllersManager::beginCycle(const Cycle& cycle) noexcept {
  cycle_ = cycle;
  buffer_ = records_->begin();
  cycle_number_.store(cycle.number, std::memory_order_relaxed);
  // The stores may have been fixed by another manager, or by the host.
  if (!laid_out_ || original_.dataSize() != control_.dataSize()) freeze();
  if (offered_.load(std::memory_order_relaxed) == nullptr) return;
  adopt(offered_.exchange(nullptr, std::memory_order_acq_rel));
}

void FeedbackControllersManager::adoptPrepared() noexcept {
  if (prepared_.load(std::memory_order_relaxed) == nullptr) return;
  const Plan* first = prepared_.exchange(nullptr, std::memory_order_acq_rel);
  if (!first) return;
  // An older one may have been offered since beginCycle(): it must not come afterwards.
  const Plan* second = offered_.exchange(nullptr, std::memory_order_acq_rel);
  if (second && second->generation < first->generation) std::swap(first, second);
  adopt(first);
  adopt(second);
}

void FeedbackControllersManager::adopt(const Plan* plan) noexcept {
  if (!plan) return;
  plan_ = plan;
  for (const PlanEntry& entry : plan->entries) entry.slot->adopt(entry);
  acknowledged_.store(plan->generation, std::memory_order_release);
}

void FeedbackControllersManager::updateStage(Stage stage, const RobotStates& robot,
                                             ControlStates& control) noexcept {
  if (!plan_ || plan_->stages[static_cast<int>(stage)].empty()) return;
  if (control.dataSize() != original_.dataSize()) {
    CTRL_MORE_LOG(log_, Error, "control states of {} numbers were given, {} expected: nothing run",
                  control.dataSize(), original_.dataSize());
    return;
  }
  original_.copyValuesFrom(control);
  for (const int offset : signals_) found_[offset] = original_.data() + offset;
  runStage(stage, robot, control);
}

void FeedbackControllersManager::runStage(Stage stage, const RobotStates& robot,
                                          ControlStates& control) noexcept {
  StageRun run{cycle_,
               robot,
               original_,
               control,
               control.data(),
               found_.data(),
               options_.check_undeclared ? compared_.data() : nullptr,
               options_.timed || plan_->timed,
               buffer_,
               static_cast<double>(cycle_.number),
               0};
  recorded_ = true;
  if (run.timed) run.boundary_ns = steadyNow();
  ControllerSlot::runAll(plan_->stages[static_cast<int>(stage)], run);
}

void FeedbackControllersManager::endCycle() noexcept {
  if (recorded_) recorded_cycle_[buffer_] = cycle_.number;
  records_->end(recorded_);
  recorded_ = false;
}

void FeedbackControllersManager::update(const Cycle& cycle, const RobotStates& robot,
                                        ControlStates& control) noexcept {
  beginCycle(cycle);
  updateStage(Stage::Task, robot, control);
  updateStage(Stage::Joint, robot, control);
  endCycle();
}

void FeedbackControllersManager::update(const RobotStates& robot,
                                        ControlStates* control) noexcept {
  if (!control) return;
  update({robot.newestStamp(), control->controlPeriod(), cycle_.number + 1}, robot, *control);
}

}  // namespace ctrl_more
