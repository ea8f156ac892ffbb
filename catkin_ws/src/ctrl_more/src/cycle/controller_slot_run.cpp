// What a ControllerSlot does in the control cycle.
#include <algorithm>

#include "cycle/controller_slot.hpp"
#include "cycle/correction.hpp"
#include "cycle/steady_now.hpp"

namespace ctrl_more {

void ControllerSlot::run(StageRun& run) noexcept {
  if (activity_ == Activity::Off && !wanted_) return;
  guard_.note(run.control.data());
  if (gain_weight_ < 1.0) advanceGains(run.cycle.dt);
  if (!wanted_) {
    runStopped(run);
  } else if (findStale(run)) {
    // What was held during a pause or a fault is let go as well.
    if (activity_ != Activity::Waiting) stop(Why::Stale);
    runStopped(run);
  } else {
    if (activity_ != Activity::Running) start();
    runActive(run);
  }
}

// True if an input is missing or too old; remembers which one.
bool ControllerSlot::findStale(const StageRun& run) noexcept {
  for (std::size_t i = 0; i < needed_.size(); ++i) {
    const Needed& need = needed_[i];
    if (run.robot.isFresh(need.signal, run.cycle.now_ns, need.max_age_ns)) continue;
    waiting_.store(static_cast<int>(i), std::memory_order_relaxed);
    return true;
  }
  return false;
}

void ControllerSlot::runActive(StageRun& run) noexcept {
  try {
    const FaultKind kind = callController(run);
    if (kind != FaultKind::None) return takeFault(run, kind, nullptr);
  } catch (const std::exception& e) {
    // The text dies with the exception: it is used before that.
    return takeFault(run, FaultKind::Exception, e.what());
  } catch (...) {
    return takeFault(run, FaultKind::Exception, "it threw something that is not a std::exception");
  }
  if (run.timed && isLate(run)) return overrun(run);
  advanceBlend(run.cycle.dt);
  if (blend_ < 1.0) blendIn(run.control.data());
  commit(run);
}

// Runs the controller, which may throw, and judges what it left.
FaultKind ControllerSlot::callController(StageRun& run) {
  double* const data = run.control.data();
  const int size = run.control.dataSize();
  if (run.compared) std::copy_n(data, size, run.compared->data());
  if (reset_pending_) {
    reset_pending_ = false;
    controller_.reset();
  }
  if (gains_pending_) {
    gains_pending_ = false;
    controller_.gainsChanged();
  }
  ModifiedControlStates modified(run.control, owner_);
  controller_.update(run.cycle, run.robot, run.original, modified);
  if (controller_.failure_) return FaultKind::Declared;
  const FaultKind kind = guard_.judge(data, run.cycle.dt);
  if (kind != FaultKind::None) return kind;
  if (run.compared && guard_.restoreUndeclared(data, run.compared->data(), size)) {
    return FaultKind::Undeclared;
  }
  if (!state_.empty()) {
    controller_.state(Numbers<>(state_.data(), static_cast<int>(state_.size())));
  }
  return FaultKind::None;
}

// Undoes what the controller wrote, and lets its last correction go.
void ControllerSlot::takeFault(StageRun& run, FaultKind kind, const char* text) noexcept {
  guard_.restore(run.control.data());
  if (run.compared) {
    guard_.restoreUndeclared(run.control.data(), run.compared->data(), run.control.dataSize());
  }
  if (kind == FaultKind::Declared) text = controller_.failure_;
  if (kind == FaultKind::Undeclared) {
    text = "it changed a reference that its description does not name";
  }
  controller_.failure_ = nullptr;
  latch(run.cycle, kind, text);
  runStopped(run);
}

// One cycle of a controller that does not run: its last correction is held, or fades.
void ControllerSlot::runStopped(StageRun& run) noexcept {
  if (activity_ == Activity::Off) return;
  advanceBlend(run.cycle.dt);
  bool holding = false;
  for (const WrittenSignal& w : guard_.written()) {
    const StopPolicy policy = policyOf(w);
    if (policy == StopPolicy::Zero || (policy == StopPolicy::Fade && blend_ >= 1.0)) continue;
    const double* c = from_.data() + w.local;
    if (policy == StopPolicy::Hold) {
      holding = true;
    } else {
      double* const fading = now_.data() + w.local;
      correction::setIdentity(w.kind, w.size, fading);
      correction::between(w.kind, w.size, c, fading, blend_, fading);
      c = fading;
    }
    double* const value = run.control.data() + w.offset;
    correction::apply(w.kind, w.size, value, c, value);
  }
  commit(run);
  if (blend_ >= 1.0 && !holding && activity_ == Activity::Stopping) setActivity(Activity::Off);
  // What this took is not the next controller's.
  if (run.timed) run.boundary_ns = steadyNow();
}

void ControllerSlot::blendIn(double* data) noexcept {
  for (const WrittenSignal& w : guard_.written()) {
    double* const c = now_.data() + w.local;
    const double* const found = guard_.found() + w.local;
    correction::difference(w.kind, w.size, found, data + w.offset, c);
    correction::between(w.kind, w.size, from_.data() + w.local, c, blend_, c);
    correction::apply(w.kind, w.size, found, c, data + w.offset);
  }
}

StopPolicy ControllerSlot::policyOf(const WrittenSignal& written) const {
  const StopPolicy by_kind =
      written.kind == SignalKind::Vector ? StopPolicy::Fade : StopPolicy::Hold;
  switch (why_) {
    case Why::Paused:
      return written.on_pause == StopPolicy::ByKind ? by_kind : written.on_pause;
    case Why::Fault:
      return on_fault_ == StopPolicy::ByKind ? by_kind : on_fault_;
    case Why::Disabled:
    case Why::Stale:
      break;
  }
  return StopPolicy::Fade;
}

// Records what the controller found and what is there now.
void ControllerSlot::commit(const StageRun& run) noexcept {
  Record& record = records_[run.buffer];
  last_ = run.buffer;
  record.any = true;
  record.cycle = run.cycle.number;
  const double* const data = run.control.data();
  for (const WrittenSignal& w : guard_.written()) {
    std::copy_n(guard_.found() + w.local, w.size, record.before.data() + w.local);
    std::copy_n(data + w.offset, w.size, record.after.data() + w.local);
  }
  std::copy(state_.begin(), state_.end(), record.state.begin());
}

// One reading of the clock per controller: the end of one is the beginning of the next.
bool ControllerSlot::isLate(StageRun& run) noexcept {
  const std::int64_t now = steadyNow();
  const std::int64_t duration_ns = now - run.boundary_ns;
  run.boundary_ns = now;
  last_ns_.store(duration_ns, std::memory_order_relaxed);
  if (!isTimed()) return false;
  if (duration_ns > overrun_ns_) return true;
  overruns_in_row_ = 0;
  return false;
}

// What it wrote came too late: the correction of the cycle before is used again.
void ControllerSlot::overrun(StageRun& run) noexcept {
  overruns_.fetch_add(1, std::memory_order_relaxed);
  guard_.forgetRate();
  guard_.restore(run.control.data());
  lastCorrection(now_.data());
  for (const WrittenSignal& w : guard_.written()) {
    double* const value = run.control.data() + w.offset;
    correction::apply(w.kind, w.size, value, now_.data() + w.local, value);
  }
  commit(run);
  if (++overruns_in_row_ >= overruns_to_pause_) {
    latch(run.cycle, FaultKind::Overrun, "update() was too slow in too many cycles in a row");
  }
}

}  // namespace ctrl_more
