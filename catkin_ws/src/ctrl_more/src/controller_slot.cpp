#include "controller_slot.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace ctrl_more {
namespace {

const std::string kNoLibrary;

std::int64_t toNanoseconds(double seconds) {
  return seconds >= 9e9 ? INT64_MAX : static_cast<std::int64_t>(1e9 * seconds);
}

}  // namespace

ControllerSlot::ControllerSlot(ControllerInstance instance, const std::string& name,
                               const ControllerEntry& entry, const ManagerOptions& options,
                               std::uint32_t owner)
    : instance_(std::move(instance)),
      controller_(instance_.controller.get()),
      owner_(owner),
      blend_s_(entry.blend_s >= 0.0 ? entry.blend_s : options.blend_s),
      gain_blend_s_(blend_s_),
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
    total += use.signal.size();
  }
  for (auto* buffer : {&before_, &after_, &from_, &raw_, &scratch_}) buffer->assign(total, 0.0);
  for (const Written& w : written_) {
    for (auto* buffer : {&from_, &raw_, &scratch_}) {
      correction::setIdentity(w.kind, w.size, buffer->data() + w.local);
    }
    // Equal and unit, so that the difference before the first run is the identity.
    correction::setIdentity(w.kind, w.size, before_.data() + w.local);
    correction::setIdentity(w.kind, w.size, after_.data() + w.local);
  }
  gains_from_ = gains;
  gains_to_ = gains;
  correction_ = std::make_unique<SharedSnapshot>(1 + 2 * static_cast<std::size_t>(total));
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
  } else if (!running && !enabled_ && activity_ != Activity::Off) {
    captureCorrection();  // a held correction is let go once the controller is disabled
    why_ = Why::Disabled;
    setActivity(Activity::Stopping);
  } else if (activity_ == Activity::Waiting && !wanted_) {
    setActivity(Activity::Stopping);
  }
}

void ControllerSlot::captureCorrection() noexcept {
  for (const Written& w : written_) {
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
  if (gain_weight_ >= 1.0) return;
  gain_weight_ = gain_blend_s_ > 0.0 ? std::min(1.0, gain_weight_ + dt / gain_blend_s_) : 1.0;
  controller_->gains_.blend(gains_from_, gains_to_, gain_weight_);
  gains_pending_ = true;
}

bool ControllerSlot::isFresh(const Cycle& cycle, const RobotStates& robot) noexcept {
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
  advanceGains(cycle.dt);
  if (wanted_ && isFresh(cycle, robot)) {
    if (activity_ != Activity::Running) start();
    ran_ = true;
    runGuarded(cycle, robot, original, control);
  } else {
    if (activity_ == Activity::Running || activity_ == Activity::Off) stop(Why::Stale);
    runStopped(cycle, control);
  }
}

void ControllerSlot::saveBefore(const ControlStates& control) noexcept {
  const double* data = control.data();
  for (const Written& w : written_) {
    std::copy(data + w.offset, data + w.offset + w.size, before_.data() + w.local);
  }
}

void ControllerSlot::saveAfter(const ControlStates& control) noexcept {
  const double* data = control.data();
  for (const Written& w : written_) {
    std::copy(data + w.offset, data + w.offset + w.size, after_.data() + w.local);
  }
}

void ControllerSlot::restore(ControlStates& control) noexcept {
  double* data = control.data();
  for (const Written& w : written_) {
    std::copy(before_.data() + w.local, before_.data() + w.local + w.size, data + w.offset);
  }
}

void ControllerSlot::runGuarded(const Cycle& cycle, const RobotStates& robot,
                                const ControlStates& original, ControlStates& control) noexcept {
  // The correction of the last good cycle is still in before_/after_ when this one fails.
  std::swap(before_, scratch_);
  saveBefore(control);
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
      kind = judge(cycle, control);
    }
  } catch (const std::exception& e) {
    kind = FaultKind::Exception;
    // The text dies with the exception.
    std::size_t i = 0;
    for (const char* c = e.what(); c[i] != '\0' && i + 1 < sizeof copied; ++i) copied[i] = c[i];
    copied[i] = '\0';
    text = copied;
  } catch (...) {
    kind = FaultKind::Exception;
    text = "it threw something that is not a std::exception";
  }
  if (kind != FaultKind::None) {
    restore(control);
    std::swap(before_, scratch_);
    latch(cycle, kind, text ? text : nameOf(kind));
    runStopped(cycle, control);
    return;
  }
  if (blend_ < 1.0) {
    advanceBlend(cycle.dt);
    if (blend_ < 1.0) blendIn(control);
  }
  // scratch_ keeps the reference of the cycle before, for judgeTime().
  saveAfter(control);
  publishCorrection(cycle);
}

FaultKind ControllerSlot::judge(const Cycle& cycle, const ControlStates& control) noexcept {
  const double* data = control.data();
  bool rated = false;
  for (const Written& w : written_) {
    const double* value = data + w.offset;
    if (!correction::isFinite(w.size, value)) return FaultKind::NotFinite;
    if (!correction::isUnit(w.kind, w.size, value)) return FaultKind::NotUnit;
    if (!w.limited) continue;
    double c[64];
    double* now = w.size <= 64 ? c : after_.data() + w.local;
    correction::difference(w.kind, w.size, before_.data() + w.local, value, now);
    const correction::Norms n = correction::norms(w.kind, w.size, now);
    if (n.size > w.limit.size || n.angle > w.limit.angle) return FaultKind::CorrectionSize;
    if (!w.rated) continue;
    rated = true;
    double* last = raw_.data() + w.local;
    if (raw_valid_) {
      double change[64];
      double* step = w.size <= 64 ? change : from_.data() + w.local;
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
    double* after = after_.data() + w.local;  // free until saveAfter()
    const double* before = before_.data() + w.local;
    correction::difference(w.kind, w.size, before, data + w.offset, after);
    correction::between(w.kind, w.size, from_.data() + w.local, after, blend_, after);
    correction::apply(w.kind, w.size, before, after, data + w.offset);
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
  saveBefore(control);
  for (const Written& w : written_) {
    const StopPolicy policy = policyOf(w);
    if (policy == StopPolicy::Zero || (policy == StopPolicy::Fade && blend_ >= 1.0)) continue;
    const double* c = from_.data() + w.local;
    if (policy == StopPolicy::Hold) {
      holding = true;
    } else {
      double* identity = after_.data() + w.local;
      correction::setIdentity(w.kind, w.size, identity);
      correction::between(w.kind, w.size, c, identity, blend_, identity);
      c = identity;
    }
    correction::apply(w.kind, w.size, before_.data() + w.local, c, data + w.offset);
  }
  saveAfter(control);
  publishCorrection(cycle);
  if (blend_ >= 1.0 && !holding && activity_ == Activity::Stopping) setActivity(Activity::Off);
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
  // What it wrote came too late: undone, and the correction of the cycle before is used again.
  restore(control);
  double* data = control.data();
  const std::vector<double>& last = raw_output_;
  for (const Written& w : written_) {
    correction::apply(w.kind, w.size, before_.data() + w.local, last.data() + w.local,
                      data + w.offset);
  }
  saveAfter(control);
  publishCorrection(cycle);
  raw_valid_ = false;
  if (++overruns_in_row_ >= overruns_to_pause_) {
    latch(cycle, FaultKind::Overrun, "update() was too slow in too many cycles in a row");
  }
}

}  // namespace ctrl_more
