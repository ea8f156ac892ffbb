#include "cycle/controller_slot.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cycle/correction.hpp"

namespace ctrl_more {
namespace {

std::int64_t toNanoseconds(double seconds) {
  return seconds >= 9e9 ? INT64_MAX : static_cast<std::int64_t>(1e9 * seconds);
}

}  // namespace

ControllerSlot::ControllerSlot(ControllerInstance instance, const std::string& name,
                               const ControllerEntry& entry, const ManagerOptions& options,
                               std::uint32_t owner)
    : instance_(std::move(instance)),
      controller_(*instance_.controller),
      owner_(owner),
      blend_s_(entry.blend_s >= 0.0 ? entry.blend_s : options.blend_s),
      overrun_ns_(toNanoseconds(1e-6 * entry.overrun_us)),
      overruns_to_pause_(options.overruns_to_pause),
      lockstep_(options.lockstep),
      on_fault_(entry.on_fault) {
  controller_.name_ = name;
}

void ControllerSlot::configure(const GainValues& gains, const SettingValues& settings,
                               RobotStates& robot, ControlStates& control, Logger* logger,
                               const std::atomic<std::uint64_t>* cycle) {
  FeedbackController& c = controller_;
  const Description description = c.declaration();
  const std::vector<std::string> faults = description.faults();
  if (!faults.empty()) throw std::invalid_argument("its description is wrong: " + faults.front());
  stage_ = description.stage;
  c.gains_ = gains;
  c.log_ = LogSource(logger, c.name_, cycle);
  const std::string complaint = c.judgeGains(gains);
  if (!complaint.empty()) throw std::invalid_argument(complaint);
  Setup setup(c.name_, description, gains, settings, robot, control, owner_);
  c.initialize(setup);
  setup.resolveAll();
  c.initialized_ = true;
  c.robot_uses_ = setup.robotUses();
  c.control_uses_ = setup.controlUses();
  for (const ResolvedRobotUse& use : c.robot_uses_) {
    needed_.push_back({use.signal, toNanoseconds(use.use.max_age_s)});
  }
  guard_.configure(c.control_uses_, control);
  from_.assign(guard_.total(), 0.0);
  for (const WrittenSignal& w : guard_.written()) {
    correction::setIdentity(w.kind, w.size, from_.data() + w.local);
  }
  now_ = from_;
  state_.assign(description.states.size(), 0.0);
  // Before and after are equal and unit: the correction before the first run is the identity.
  for (Record& record : records_) {
    record.before = record.after = from_;
    record.state = state_;
  }
  gains_from_ = gains;
  gains_to_ = gains;
}

void ControllerSlot::adopt(const PlanEntry& entry) noexcept {
  if (entry.gains_revision != gains_revision_) {
    gains_revision_ = entry.gains_revision;
    gains_from_.assign(controller_.gains_);
    gains_to_.assign(*entry.gains);
    gain_weight_ = 0.0;
  }
  if (entry.fault_clears != fault_clears_) {
    fault_clears_ = entry.fault_clears;
    if (fault_ != FaultKind::None) reset_pending_ = true;
    fault_ = FaultKind::None;
    overruns_in_row_ = 0;
    shared_fault_.store(FaultKind::None, std::memory_order_release);
  }
  if (!enabled_ && entry.enabled) reset_pending_ = true;
  enabled_ = entry.enabled;
  paused_ = entry.paused;
  wanted_ = enabled_ && !paused_ && fault_ == FaultKind::None;
  if (entry.resets != resets_) {
    resets_ = entry.resets;
    reset_pending_ = true;
  }
  const bool moved = entry.reorders != reorders_;
  reorders_ = entry.reorders;
  const bool running = activity_ == Activity::Running;
  if (running && !wanted_) {
    stop(!enabled_ ? Why::Disabled : Why::Paused);
  } else if (running && (moved || reset_pending_)) {
    captureCorrection();
    guard_.forgetRate();
  } else if (!running && !enabled_ && activity_ != Activity::Off && why_ != Why::Disabled) {
    captureCorrection();  // a held correction is let go once the controller is disabled
    why_ = Why::Disabled;
    setActivity(Activity::Stopping);
  } else if (activity_ == Activity::Waiting && !wanted_) {
    setActivity(Activity::Stopping);
  }
}

// The correction of the newest record.
void ControllerSlot::lastCorrection(double* correction) noexcept {
  const Record& record = records_[last_];
  for (const WrittenSignal& w : guard_.written()) {
    correction::difference(w.kind, w.size, record.before.data() + w.local,
                           record.after.data() + w.local, correction + w.local);
  }
}

void ControllerSlot::captureCorrection() noexcept {
  lastCorrection(from_.data());
  blend_ = 0.0;
}

void ControllerSlot::start() noexcept {
  captureCorrection();
  guard_.forgetRate();
  setActivity(Activity::Running);
}

void ControllerSlot::stop(Why why) noexcept {
  captureCorrection();
  why_ = why;
  guard_.forgetRate();
  setActivity(why == Why::Stale ? Activity::Waiting : Activity::Stopping);
}

void ControllerSlot::setActivity(Activity activity) noexcept {
  activity_ = activity;
  shared_activity_.store(activity, std::memory_order_release);
}

void ControllerSlot::advanceBlend(double dt) noexcept {
  if (blend_ >= 1.0) return;
  blend_ = blend_s_ > 0.0 ? std::min(1.0, blend_ + dt / blend_s_) : 1.0;
}

void ControllerSlot::advanceGains(double dt) noexcept {
  gain_weight_ = blend_s_ > 0.0 ? std::min(1.0, gain_weight_ + dt / blend_s_) : 1.0;
  controller_.gains_.blend(gains_from_, gains_to_, gain_weight_);
  gains_pending_ = true;
}

void ControllerSlot::latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept {
  fault_ = kind;
  wanted_ = false;
  fault_text_.set(text ? text : nameOf(kind));
  fault_cycle_.store(cycle.number, std::memory_order_relaxed);
  faults_.fetch_add(1, std::memory_order_relaxed);
  shared_fault_.store(kind, std::memory_order_release);
  stop(Why::Fault);
  CTRL_MORE_LOG(controller_.log_, Error, nameOf(kind));
  if (text) CTRL_MORE_LOG(controller_.log_, Error, text);
}

void ControllerSlot::fillStatus(ControllerStatus& status) const {
  status.name = name();
  status.stage = stage_;
  status.activity = activity();
  status.fault = fault();
  if (status.fault != FaultKind::None) {
    status.fault_text = std::string(nameOf(status.fault)) + ": " + fault_text_.get();
    status.fault_cycle = fault_cycle_.load(std::memory_order_relaxed);
  }
  status.faults = faults_.load(std::memory_order_relaxed);
  status.overruns = overruns_.load(std::memory_order_relaxed);
  status.last_us = 1e-3 * static_cast<double>(last_ns_.load(std::memory_order_relaxed));
  const int waiting = waiting_.load(std::memory_order_relaxed);
  if (status.activity == Activity::Waiting && waiting >= 0) {
    status.waiting_for = robotUses()[waiting].name();
  }
}

void ControllerSlot::addRecord(const ControlStates& names, unsigned buffer,
                               CycleRecord& of_cycle) const {
  const Record& record = records_[buffer];
  if (activity() == Activity::Off || !record.any || record.cycle != of_cycle.cycle) return;
  std::vector<double> change;
  for (const WrittenSignal& w : guard_.written()) {
    const double* before = record.before.data() + w.local;
    const double* after = record.after.data() + w.local;
    change.resize(w.size);
    correction::difference(w.kind, w.size, before, after, change.data());
    const correction::Norms n = correction::norms(w.kind, w.size, change.data());
    of_cycle.changes.push_back({name(),
                                names.nameOfSignal(w.signal),
                                of_cycle.cycle,
                                {before, before + w.size},
                                {after, after + w.size},
                                n.size,
                                n.angle});
  }
  if (!record.state.empty()) of_cycle.states.push_back({name(), record.state});
}

}  // namespace ctrl_more
