#include "controller_slot.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace ctrl_more {
namespace {

const std::string kNoLibrary;
constexpr double kNoCycle = -1.0;
constexpr int kMostSignals = 200;
constexpr int kMostDoubles = 30000;
constexpr std::size_t kMostStates = 1000;

std::int64_t toNanoseconds(double seconds) {
  return seconds >= 9e9 ? INT64_MAX : static_cast<std::int64_t>(1e9 * seconds);
}

}  // namespace

ControllerSlot::ControllerSlot(ControllerInstance instance, const std::string& name,
                               const ControllerEntry& entry, const ManagerOptions& options,
                               std::uint32_t owner)
    : controller_(instance.controller.get()),
      owner_(owner),
      instance_(std::move(instance)),
      blend_s_(entry.blend_s >= 0.0 ? entry.blend_s : options.blend_s),
      overrun_ns_(toNanoseconds(1e-6 * entry.overrun_us)),
      overruns_to_pause_(options.overruns_to_pause),
      lockstep_(options.lockstep),
      on_fault_(entry.on_fault) {
  controller_->name_ = name;
}

const std::string& ControllerSlot::library() const {
  return instance_.library ? instance_.library->path() : kNoLibrary;
}

void ControllerSlot::configure(const GainValues& gains, const SettingValues& settings,
                               RobotStates& robot, ControlStates& control, Logger* logger,
                               const std::atomic<std::uint64_t>* cycle) {
  FeedbackController& c = *controller_;
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
    all_needed_.push_back({use.signal, toNanoseconds(use.use.max_age_s)});
  }
  int total = 0;
  for (const ResolvedControlUse& use : c.control_uses_) {
    if (!use.use.modifies) continue;
    const CorrectionLimit& l = use.use.limit;
    const bool rated = std::isfinite(l.rate) || std::isfinite(l.angle_rate);
    const bool limited = rated || std::isfinite(l.size) || std::isfinite(l.angle);
    written_.push_back({use.signal, use.signal.offset(), total, use.signal.size(),
                        kindOf(use.use.container), l, use.use.on_pause, limited, rated});
    all_checked_.push_back({static_cast<std::uint32_t>(use.signal.offset()),
                            static_cast<std::uint16_t>(use.signal.size()),
                            kindOf(use.use.container)});
    if (limited) special_ |= kLimited;
    total += use.signal.size();
  }
  for (auto* buffer : {&from_, &raw_, &now_, &step_}) {
    buffer->assign(total, 0.0);
    for (const Written& w : written_) {
      correction::setIdentity(w.kind, w.size, buffer->data() + w.local);
    }
  }
  if (all_needed_.size() > kMostSignals || all_checked_.size() > kMostSignals ||
      total > kMostDoubles) {
    throw std::invalid_argument("it uses more signals than " + std::to_string(kMostSignals) +
                                ", or modifies more numbers than " + std::to_string(kMostDoubles));
  }
  needed_count_ = static_cast<std::uint8_t>(all_needed_.size());
  checked_count_ = static_cast<std::uint8_t>(all_checked_.size());
  if (needed_count_ == 1) needed_ = all_needed_[0];
  if (checked_count_ == 1) checked_ = all_checked_[0];
  total_ = static_cast<std::uint16_t>(total);
  if (description.states.size() > kMostStates) {
    throw std::invalid_argument("it declares more states than " + std::to_string(kMostStates));
  }
  state_.assign(description.states.size(), 0.0);
  if (!state_.empty()) special_ |= kStates;
  const int lines = (1 + 2 * total + static_cast<int>(state_.size()) + 7) / 8;
  record_size_ = static_cast<std::uint16_t>(8 * lines);
  lines_ = std::make_unique<Line[]>(2 * lines);
  records_ = lines_[0].numbers;
  // Before and after are equal and unit: the correction before the first run is the identity.
  for (double* record : {records_, records_ + record_size_}) {
    record[0] = kNoCycle;
    std::copy(from_.begin(), from_.end(), record + 1);
    std::copy(from_.begin(), from_.end(), record + 1 + total);
  }
  declared_.assign(control.dataSize(), false);
  for (const Written& w : written_) {
    for (int i = 0; i < w.size; ++i) declared_[w.offset + i] = true;
  }
  gains_from_ = gains;
  gains_to_ = gains;
}

void ControllerSlot::adopt(const PlanEntry& entry) noexcept {
  if (entry.gains_revision != gains_revision_) {
    gains_revision_ = entry.gains_revision;
    gains_from_.assign(controller_->gains_);
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
  steady_ = false;  // the next run finds out
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
    raw_valid_ = false;
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
  for (const Written& w : written_) {
    const double* before = lastRecord() + 1 + w.local;
    correction::difference(w.kind, w.size, before, before + total_, correction + w.local);
  }
}

void ControllerSlot::captureCorrection() noexcept {
  lastCorrection(from_.data());
  blend_ = 0.0;
}

void ControllerSlot::start() noexcept {
  captureCorrection();
  raw_valid_ = false;
  setActivity(Activity::Running);
}

void ControllerSlot::stop(Why why) noexcept {
  captureCorrection();
  why_ = why;
  raw_valid_ = false;
  steady_ = false;
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
  controller_->gains_.blend(gains_from_, gains_to_, gain_weight_);
  gains_pending_ = true;
}

// What only some controllers need after update(): a closer look at what it left, and its state.
// False if that was a fault, which is dealt with then.
bool ControllerSlot::passes(StageRun& run) noexcept {
  const FaultKind kind = judgeMore(run);
  if (kind != FaultKind::None) {
    takeFault(run, kind,
              kind == FaultKind::Undeclared
                  ? "it changed a reference that its description does not name"
                  : nullptr);
    return false;
  }
  if ((special_ & kStates) == 0) return true;
  try {
    controller_->state(Numbers<>(state_.data(), static_cast<int>(state_.size())));
  } catch (const std::exception& e) {
    takeFault(run, FaultKind::Exception, e.what());
    return false;
  } catch (...) {
    takeFault(run, FaultKind::Exception, "state() threw something that is not a std::exception");
    return false;
  }
  recordState(run);
  return true;
}

void ControllerSlot::recordState(const StageRun& run) noexcept {
  std::copy(state_.begin(), state_.end(),
            records_ + run.buffer * record_size_ + 1 + 2 * total_);
}

void ControllerSlot::latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept {
  fault_ = kind;
  wanted_ = false;
  fault_text_.set(text ? text : nameOf(kind));
  fault_cycle_.store(cycle.number, std::memory_order_relaxed);
  faults_.fetch_add(1, std::memory_order_relaxed);
  shared_fault_.store(kind, std::memory_order_release);
  stop(Why::Fault);
  CTRL_MORE_LOG(controller_->log_, Error, nameOf(kind));
  if (text) CTRL_MORE_LOG(controller_->log_, Error, text);
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
    const ResolvedRobotUse& use = robotUses()[waiting];
    status.waiting_for = std::string(nameOf(use.use.source)) + "/" + use.key;
  }
}

void ControllerSlot::addRecord(const ControlStates& names, unsigned buffer,
                               CycleRecord& of_cycle) const {
  const double* record = records_ + buffer * record_size_;
  if (activity() == Activity::Off || record[0] != static_cast<double>(of_cycle.cycle)) return;
  std::vector<double> change;
  for (const Written& w : written_) {
    const double* before = record + 1 + w.local;
    const double* after = before + total_;
    Attribution entry;
    entry.controller = name();
    entry.signal = names.nameOfSignal(w.signal);
    entry.cycle = of_cycle.cycle;
    entry.before.assign(before, before + w.size);
    entry.after.assign(after, after + w.size);
    change.resize(w.size);
    correction::difference(w.kind, w.size, before, after, change.data());
    const correction::Norms n = correction::norms(w.kind, w.size, change.data());
    entry.size = n.size;
    entry.angle = n.angle;
    of_cycle.changes.push_back(entry);
  }
  if (state_.empty()) return;
  const double* const state = record + 1 + 2 * total_;
  of_cycle.states.push_back({name(), {state, state + state_.size()}});
}

}  // namespace ctrl_more
