#include "controller_slot.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <type_traits>

namespace ctrl_more {
namespace {

const std::string kNoLibrary;

// Calls `function` with the size, as a constant for the usual ones, so that its loops unroll.
template <typename Function>
inline void forSize(int size, Function function) {
  switch (size) {
    case 3: return function(std::integral_constant<int, 3>());
    case 4: return function(std::integral_constant<int, 4>());
    case 6: return function(std::integral_constant<int, 6>());
    case 7: return function(std::integral_constant<int, 7>());
    default: return function(size);
  }
}

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
    needed_.push_back({use.signal, toNanoseconds(use.use.max_age_s)});
  }
  int total = 0;
  for (const ResolvedControlUse& use : c.control_uses_) {
    if (!use.use.modifies) continue;
    const CorrectionLimit& l = use.use.limit;
    const bool rated = std::isfinite(l.rate) || std::isfinite(l.angle_rate);
    const bool limited = rated || std::isfinite(l.size) || std::isfinite(l.angle);
    written_.push_back({use.signal, use.signal.offset(), total, use.signal.size(),
                        kindOf(use.use.container), l, use.use.on_pause, limited, rated});
    limited_ = limited_ || limited;
    total += use.signal.size();
  }
  for (auto* buffer : {&from_, &raw_, &now_, &step_, &before_, &after_}) {
    buffer->assign(total, 0.0);
    for (const Written& w : written_) {
      correction::setIdentity(w.kind, w.size, buffer->data() + w.local);
    }
  }
  records_ = std::make_unique<SharedRecords>(1 + 2 * static_cast<std::size_t>(total));
  for (int both = 0; both < 2; ++both) {
    // Equal and unit, so that the correction before the first run is the identity.
    for (int i = 0; i < total; ++i) {
      records_->put(1 + 2 * i, before_[i]);
      records_->put(2 + 2 * i, before_[i]);
    }
    records_->close();
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

void ControllerSlot::captureCorrection() noexcept {
  for (const Written& w : written_) {
    for (int i = w.local; i < w.local + w.size; ++i) {
      before_[i] = records_->last(1 + 2 * i);
      after_[i] = records_->last(2 + 2 * i);
    }
    correction::difference(w.kind, w.size, before_.data() + w.local, after_.data() + w.local,
                           from_.data() + w.local);
  }
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

inline bool ControllerSlot::isFresh(const Cycle& cycle, const RobotStates& robot) noexcept {
  for (std::size_t i = 0; i < needed_.size(); ++i) {
    if (robot.isFresh(needed_[i].signal, cycle.now_ns, needed_[i].max_age_ns)) continue;
    waiting_.store(static_cast<int>(i), std::memory_order_relaxed);
    return false;
  }
  return true;
}

void ControllerSlot::run(const Cycle& cycle, const RobotStates& robot,
                         const ControlStates& original, ControlStates& control) noexcept {
  ran_ = false;
  if (idle()) return;
  if (gain_weight_ < 1.0) advanceGains(cycle.dt);
  if (wanted_ && isFresh(cycle, robot)) {
    if (activity_ != Activity::Running) start();
    ran_ = true;
    runGuarded(cycle, robot, original, control);
  } else {
    if (activity_ == Activity::Running || activity_ == Activity::Off) stop(Why::Stale);
    runStopped(cycle, control);
  }
}

inline void ControllerSlot::openRecord(const Cycle& cycle, const double* data) noexcept {
  records_->put(0, static_cast<double>(cycle.number));
  std::atomic<double>* const record = records_->making();
  for (const Written& w : written_) {
    forSize(w.size, [&](auto size) {
      const double* value = data + w.offset;
      std::atomic<double>* word = record + 1 + 2 * w.local;
      for (int i = 0; i < size; ++i) word[2 * i].store(value[i], std::memory_order_release);
    });
  }
}

inline FaultKind ControllerSlot::fillAfter(const double* data) noexcept {
  std::atomic<double>* const record = records_->making();
  FaultKind fault = FaultKind::None;
  for (const Written& w : written_) {
    const double* value = data + w.offset;
    std::uint64_t collected = 0;
    forSize(w.size, [&](auto size) {
      std::atomic<double>* word = record + 2 + 2 * w.local;
      for (int i = 0; i < size; ++i) {
        const double v = value[i];
        collected |= correction::notFinite(v);
        word[2 * i].store(v, std::memory_order_release);
      }
    });
    if (collected != 0) return FaultKind::NotFinite;
    if (!correction::isUnit(w.kind, w.size, value)) fault = FaultKind::NotUnit;
  }
  return fault;
}

// Puts back what was found when the record being made was opened.
void ControllerSlot::restore(double* data) noexcept {
  for (const Written& w : written_) {
    for (int i = 0; i < w.size; ++i) data[w.offset + i] = records_->made(1 + 2 * (w.local + i));
  }
}

void ControllerSlot::runGuarded(const Cycle& cycle, const RobotStates& robot,
                                const ControlStates& original, ControlStates& control) noexcept {
  double* data = control.data();
  openRecord(cycle, data);
  FaultKind kind = FaultKind::None;
  const char* text = nullptr;
  char copied[96];
  try {
    if (reset_pending_) {
      reset_pending_ = false;
      controller_->reset();
    }
    if (gains_pending_) {
      gains_pending_ = false;
      controller_->gainsChanged();
    }
    ModifiedControlStates modified(control, owner_);
    controller_->update(cycle, robot, original, modified);
    if (controller_->failure_) {
      kind = FaultKind::Declared;
      text = controller_->failure_;
      controller_->failure_ = nullptr;
    } else {
      kind = fillAfter(data);
      if (kind == FaultKind::None && limited_) kind = judgeLimits(cycle, data);
    }
  } catch (const std::exception& e) {
    kind = FaultKind::Exception;
    // The text dies with the exception.
    const char* what = e.what();
    std::size_t i = 0;
    for (; what[i] != '\0' && i + 1 < sizeof copied; ++i) copied[i] = what[i];
    copied[i] = '\0';
    text = copied;
  } catch (...) {
    kind = FaultKind::Exception;
    text = "it threw something that is not a std::exception";
  }
  if (kind != FaultKind::None) {
    restore(data);
    latch(cycle, kind, text);
    runStopped(cycle, control);
    return;
  }
  if (blend_ < 1.0) {
    advanceBlend(cycle.dt);
    if (blend_ < 1.0) blendIn(control);
    fillAfter(data);
  }
  records_->close();
}

FaultKind ControllerSlot::judgeLimits(const Cycle& cycle, const double* data) noexcept {
  bool rated = false;
  for (const Written& w : written_) {
    if (!w.limited) continue;
    double* now = now_.data() + w.local;
    double* before = before_.data() + w.local;
    for (int i = 0; i < w.size; ++i) before[i] = records_->made(1 + 2 * (w.local + i));
    correction::difference(w.kind, w.size, before, data + w.offset, now);
    const correction::Norms n = correction::norms(w.kind, w.size, now);
    if (n.size > w.limit.size || n.angle > w.limit.angle) return FaultKind::CorrectionSize;
    if (!w.rated) continue;
    rated = true;
    double* last = raw_.data() + w.local;
    if (raw_valid_) {
      double* step = step_.data() + w.local;
      correction::difference(w.kind, w.size, last, now, step);
      const correction::Norms r = correction::norms(w.kind, w.size, step);
      if (r.size > w.limit.rate * cycle.dt || r.angle > w.limit.angle_rate * cycle.dt) {
        return FaultKind::CorrectionRate;
      }
    }
    std::copy(now, now + w.size, last);
  }
  raw_valid_ = rated;
  return FaultKind::None;
}

void ControllerSlot::blendIn(ControlStates& control) noexcept {
  double* data = control.data();
  for (const Written& w : written_) {
    double* c = now_.data() + w.local;
    double* before = before_.data() + w.local;
    for (int i = 0; i < w.size; ++i) before[i] = records_->made(1 + 2 * (w.local + i));
    correction::difference(w.kind, w.size, before, data + w.offset, c);
    correction::between(w.kind, w.size, from_.data() + w.local, c, blend_, c);
    correction::apply(w.kind, w.size, before, c, data + w.offset);
  }
}

StopPolicy ControllerSlot::policyOf(const Written& written) const {
  const StopPolicy by_kind =
      written.kind == SignalKind::Vector ? StopPolicy::Fade : StopPolicy::Hold;
  switch (why_) {
    case Why::Paused:
      return written.on_pause == StopPolicy::ByKind ? by_kind : written.on_pause;
    case Why::Fault: return on_fault_ == StopPolicy::ByKind ? by_kind : on_fault_;
    case Why::Disabled:
    case Why::Stale: break;
  }
  return StopPolicy::Fade;
}

void ControllerSlot::runStopped(const Cycle& cycle, ControlStates& control) noexcept {
  if (activity_ == Activity::Off) return;
  advanceBlend(cycle.dt);
  bool holding = false;
  double* data = control.data();
  openRecord(cycle, data);
  for (const Written& w : written_) {
    const StopPolicy policy = policyOf(w);
    if (policy == StopPolicy::Zero || (policy == StopPolicy::Fade && blend_ >= 1.0)) continue;
    const double* c = from_.data() + w.local;
    if (policy == StopPolicy::Hold) {
      holding = true;
    } else {
      double* fading = now_.data() + w.local;
      correction::setIdentity(w.kind, w.size, fading);
      correction::between(w.kind, w.size, c, fading, blend_, fading);
      c = fading;
    }
    correction::apply(w.kind, w.size, data + w.offset, c, data + w.offset);
  }
  fillAfter(data);
  records_->close();
  if (blend_ >= 1.0 && !holding && activity_ == Activity::Stopping) setActivity(Activity::Off);
}

// Takes back the run just recorded; the correction of the run before is used again, as a record of
// its own.
void ControllerSlot::undo(const Cycle& cycle, double* data) noexcept {
  raw_valid_ = false;
  for (const Written& w : written_) {
    double* before = before_.data() + w.local;
    double* after = after_.data() + w.local;
    double* held = now_.data() + w.local;
    for (int i = 0; i < w.size; ++i) {
      before[i] = records_->previous(1 + 2 * (w.local + i));
      after[i] = records_->previous(2 + 2 * (w.local + i));
    }
    correction::difference(w.kind, w.size, before, after, held);
    for (int i = 0; i < w.size; ++i) data[w.offset + i] = records_->last(1 + 2 * (w.local + i));
  }
  openRecord(cycle, data);
  for (const Written& w : written_) {
    correction::apply(w.kind, w.size, data + w.offset, now_.data() + w.local, data + w.offset);
  }
  fillAfter(data);
  records_->close();
}

void ControllerSlot::judgeTime(const Cycle& cycle, std::int64_t duration_ns,
                               ControlStates& control) noexcept {
  last_ns_.store(duration_ns, std::memory_order_relaxed);
  if (lockstep_ || overrun_ns_ == 0 || !ran_ || activity_ != Activity::Running) return;
  if (duration_ns <= overrun_ns_) {
    overruns_in_row_ = 0;
    return;
  }
  overruns_.fetch_add(1, std::memory_order_relaxed);
  // What it wrote came too late.
  undo(cycle, control.data());
  if (++overruns_in_row_ >= overruns_to_pause_) {
    latch(cycle, FaultKind::Overrun, "update() was too slow in too many cycles in a row");
  }
}

void ControllerSlot::checkUndeclared(const Cycle& cycle, const double* before,
                                     ControlStates& control) noexcept {
  double* data = control.data();
  bool changed = false;
  for (int i = 0; i < control.dataSize(); ++i) {
    const bool declared = i < static_cast<int>(declared_.size()) && declared_[i];
    if (declared || std::memcmp(data + i, before + i, sizeof(double)) == 0) continue;
    data[i] = before[i];
    changed = true;
  }
  if (!changed || activity_ != Activity::Running) return;
  undo(cycle, data);
  latch(cycle, FaultKind::Undeclared, "it changed a reference that its description does not name");
  for (const Written& w : written_) {
    for (int i = 0; i < w.size; ++i) data[w.offset + i] = records_->last(1 + 2 * (w.local + i));
  }
  runStopped(cycle, control);
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

void ControllerSlot::attribution(const ControlStates& names,
                                 std::vector<Attribution>& list) const {
  if (activity() == Activity::Off) return;
  std::vector<double> numbers;
  if (!records_->read(numbers)) return;
  std::size_t next = 1;
  std::vector<double> change;
  for (const Written& w : written_) {
    Attribution entry;
    entry.controller = name();
    entry.signal = names.nameOfSignal(w.signal);
    entry.cycle = static_cast<std::uint64_t>(numbers[0]);
    for (int i = 0; i < w.size; ++i) {
      entry.before.push_back(numbers[next++]);
      entry.after.push_back(numbers[next++]);
    }
    change.resize(w.size);
    correction::difference(w.kind, w.size, entry.before.data(), entry.after.data(), change.data());
    const correction::Norms n = correction::norms(w.kind, w.size, change.data());
    entry.size = n.size;
    entry.angle = n.angle;
    list.push_back(entry);
  }
}

}  // namespace ctrl_more
