#include "ctrl_more/manager/feedback_controllers_manager.hpp"

#include <utility>

#include "cycle/cycle_runner.hpp"
#include "manager/roster.hpp"

namespace ctrl_more {

FeedbackControllersManager::FeedbackControllersManager(RobotStates& robot, ControlStates& control,
                                                       const ManagerOptions& options,
                                                       Logger* logger)
    : robot_(robot),
      control_(control),
      options_(options),
      logger_(logger ? logger : &Logger::standard()),
      runner_(std::make_unique<CycleRunner>(robot, control, options, logger_)) {}

FeedbackControllersManager::~FeedbackControllersManager() {
  for (auto& member : roster_->members) member->slot->setOwner(nullptr);
  roster_->members.clear();  // before the runner, whose cycle number they log
}

Status FeedbackControllersManager::apply(const Change& change) {
  return this->change(change, false);
}

Status FeedbackControllersManager::prepare(const Change& change) {
  return this->change(change, true);
}

// Everything that can fail comes before the publication: what fails has changed nothing.
Status FeedbackControllersManager::change(const Change& change, bool prepared) {
  const ChangeLock lock(*roster_);
  if (!lock) return ChangeLock::busy();
  Draft draft = roster_->draft();
  const Status tried = tryChange(*roster_, change, draft);
  if (!tried) return tried;
  std::string note = tried.message();
  auto before = std::make_unique<Draft>(roster_->draft());
  Status status = publish(std::move(draft), prepared);
  before_last_ = std::move(before);
  status.note(std::move(note));
  return status;
}

// Makes the draft the truth, and offers it to the cycle as a plan. If memory runs out, nothing has
// changed.
Status FeedbackControllersManager::publish(Draft draft, bool prepared) {
  PlanExchange& plans = runner_->plans();
  plans.store(roster_->planOf(draft, plans.generation() + 1));
  return commit(std::move(draft), prepared);
}

// The part of publish() that cannot fail; the plan is stored.
Status FeedbackControllersManager::commit(Draft draft, bool prepared) noexcept {
  {
    const RosterLock lock(roster_->mutex);
    roster_->accept(std::move(draft));
  }
  before_last_.reset();
  runner_->plans().offer(prepared);
  return Status::published(runner_->plans().generation());
}

bool FeedbackControllersManager::waitAdopted(std::uint64_t generation, double timeout_s) const {
  return runner_->plans().wait(generation, timeout_s);
}

Status FeedbackControllersManager::withdraw(std::uint64_t generation) {
  const ChangeLock lock(*roster_);
  if (!lock) return ChangeLock::busy();
  PlanExchange& plans = runner_->plans();
  if (generation != plans.generation() || !before_last_ ||
      before_last_->states.size() != roster_->members.size()) {
    return Status::failure("plan " + std::to_string(generation) +
                           " cannot be withdrawn: the newest one is " +
                           std::to_string(plans.generation()));
  }
  plans.store(roster_->planOf(*before_last_, generation + 1));
  if (!plans.retract()) {
    return Status::failure("plan " + std::to_string(generation) + " is adopted already",
                           Cause::Busy);
  }
  const std::unique_ptr<Draft> back = std::move(before_last_);
  return commit(std::move(*back), false);
}

CycleRecord FeedbackControllersManager::lastCycle() const {
  const RosterLock lock(roster_->mutex);
  CycleRecord record;
  const unsigned buffer = runner_->acquireRecords(record.cycle);
  for (const std::string& name : roster_->order) {
    roster_->member(name).slot->addRecord(control_, buffer, record);
  }
  return record;
}

void FeedbackControllersManager::freeze() { runner_->freeze(); }

void FeedbackControllersManager::beginCycle(const Cycle& cycle) noexcept { runner_->begin(cycle); }

void FeedbackControllersManager::adoptPrepared() noexcept { runner_->adoptPrepared(); }

void FeedbackControllersManager::updateStage(Stage stage, const RobotStates& robot,
                                             ControlStates& control) noexcept {
  runner_->runStage(stage, robot, control);
}

void FeedbackControllersManager::endCycle() noexcept { runner_->end(); }

void FeedbackControllersManager::update(const Cycle& cycle, const RobotStates& robot,
                                        ControlStates& control) noexcept {
  beginCycle(cycle);
  updateStage(Stage::Task, robot, control);
  updateStage(Stage::Joint, robot, control);
  endCycle();
}

void FeedbackControllersManager::update(const RobotStates& robot, ControlStates* control) noexcept {
  if (!control) return;
  update({robot.newestStamp(), control->controlPeriod(), runner_->cycle().number + 1}, robot,
         *control);
}

}  // namespace ctrl_more
