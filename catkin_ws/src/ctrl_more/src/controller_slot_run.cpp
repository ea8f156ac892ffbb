// What a ControllerSlot does in the control cycle.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "controller_slot.hpp"
#include "steady_now.hpp"

namespace ctrl_more {
namespace {

constexpr int kLine = 8;  // doubles in a cache line

// Nothing of this is called where every controller runs undisturbed.
#define CTRL_MORE_RARE __attribute__((noinline, cold))
// All of this is.
#define CTRL_MORE_OFTEN __attribute__((always_inline)) inline

// One signal of N numbers into the record, as it was found and as it was left.
template <std::size_t N>
CTRL_MORE_OFTEN void recordSignal(const double* found, const double* left, double* record,
                                  std::size_t total) {
  std::memcpy(record, found, N * sizeof(double));
  std::memcpy(record + total, left, N * sizeof(double));
}

// The same for any size.
__attribute__((noinline)) void recordAny(std::size_t size, const double* found, const double* left,
                                         double* record, std::size_t total) {
  switch (size) {
    case 3: return recordSignal<3>(found, left, record, total);
    case 4: return recordSignal<4>(found, left, record, total);
    case 6: return recordSignal<6>(found, left, record, total);
    case 7: return recordSignal<7>(found, left, record, total);
    default: break;
  }
  std::memcpy(record, found, size * sizeof(double));
  std::memcpy(record + total, left, size * sizeof(double));
}

}  // namespace

CTRL_MORE_OFTEN bool ControllerSlot::isFresh(const StageRun& run) const noexcept {
  if (needed_count_ == 1) {
    return run.robot.isFresh(needed_.signal, run.cycle.now_ns, needed_.max_age_ns);
  }
  for (const Needed& need : all_needed_) {
    if (!run.robot.isFresh(need.signal, run.cycle.now_ns, need.max_age_ns)) return false;
  }
  return true;
}

// Which of its inputs it waits for.
void ControllerSlot::noteWaiting(const StageRun& run) noexcept {
  for (unsigned i = 0; i < needed_count_; ++i) {
    const Needed& need = needed()[i];
    if (run.robot.isFresh(need.signal, run.cycle.now_ns, need.max_age_ns)) continue;
    waiting_.store(static_cast<int>(i), std::memory_order_relaxed);
    return;
  }
}

// Everything before update() of a controller that is not steady, or has become stale. False if it
// is not to run.
CTRL_MORE_RARE bool ControllerSlot::prepare(StageRun& run) noexcept {
  if (idle()) return false;
  if (gain_weight_ < 1.0) advanceGains(run.cycle.dt);
  if (wanted_ && isFresh(run)) {
    if (activity_ != Activity::Running) start();
    return true;
  }
  if (wanted_) {
    noteWaiting(run);
    // What was held during a pause or a fault is let go as well.
    if (activity_ != Activity::Waiting) stop(Why::Stale);
  }
  runStopped(run);
  return false;
}

// Brings what the next controllers need into the cache while this one runs: together, many
// controllers have more than fits.
CTRL_MORE_OFTEN void ControllerSlot::fetchAhead(ControllerSlot* const* here,
                                                const ControllerSlot* const* end,
                                                const StageRun& run) noexcept {
  if (here + 2 < end) {
    __builtin_prefetch(here[2]);
    const ControllerSlot& next = *here[1];
    const double* record = next.records_ + (run.buffer ? next.record_size_ : 0);
    __builtin_prefetch(record, 1);
    __builtin_prefetch(record + kLine, 1);
    __builtin_prefetch(next.controller_);
  }
}

void ControllerSlot::runAll(const std::vector<ControllerSlot*>& slots, StageRun& run) noexcept {
  if (run.compared) {
    runEach<true, true>(slots, run);
  } else if (run.timed) {
    runEach<true, false>(slots, run);
  } else {
    runEach<false, false>(slots, run);
  }
}

template <bool kTimed, bool kTest>
void ControllerSlot::runEach(const std::vector<ControllerSlot*>& slots, StageRun& run) noexcept {
  const ControllerSlot* const* const end = slots.data() + slots.size();
  for (ControllerSlot* const& slot : slots) {
    ControllerSlot& s = *slot;
    fetchAhead(&slot, end, run);
    const bool steady = s.steady_ && s.isFresh(run);
    if (!steady && !s.prepare(run)) continue;
    if (kTest) std::memcpy(run.compared, run.data, run.control.dataSize() * sizeof(double));
    try {
      if (!steady) s.catchUp();
      ModifiedControlStates modified(run.control, s.owner_);
      s.controller_->update(run.cycle, run.robot, run.original, modified);
    } catch (const std::exception& e) {
      // The text dies with the exception: it is used before that.
      s.takeFault(run, FaultKind::Exception, e.what());
      continue;
    } catch (...) {
      s.takeFault(run, FaultKind::Exception, "it threw something that is not a std::exception");
      continue;
    }
    if (s.controller_->failure_) {
      s.takeFailure(run);
      continue;
    }
    if ((!s.hasGoodNumbers(run.data) || s.special_ != 0 || kTest) && !s.passes(run)) continue;
    if (kTimed && (!kTest || run.timed) && s.isLate(run)) {
      s.overrun(run);
      continue;
    }
    if (!steady) s.settle(run);
    s.commit(run);
  }
}

// Tells the controller what happened since it ran last; what it throws is a fault.
CTRL_MORE_RARE void ControllerSlot::catchUp() {
  if (reset_pending_) {
    reset_pending_ = false;
    controller_->reset();
  }
  if (gains_pending_) {
    gains_pending_ = false;
    controller_->gainsChanged();
  }
}

// Everything after update() of a controller that is not steady.
CTRL_MORE_RARE void ControllerSlot::settle(StageRun& run) noexcept {
  if (blend_ < 1.0) {
    advanceBlend(run.cycle.dt);
    if (blend_ < 1.0) blendIn(run);
  }
  steady_ = blend_ >= 1.0 && gain_weight_ >= 1.0;
}

// The quick half of judgeNumbers(): true only if every number is finite and every quaternion unit.
CTRL_MORE_OFTEN bool ControllerSlot::isGood(const Checked& c, const double* data) noexcept {
  const double* value = data + c.offset;
  // A sum that is finite has finite terms, and less itself is zero; else that is NaN.
  if (c.kind == SignalKind::Pose) {
    const double sum = (value[0] + value[1]) + value[2];
    const double off = correction::squareOff(value + 3);
    return std::abs((sum - sum) + off) <= correction::kUnitTolerance;
  }
  return isGoodToo(c, value);
}

// The same for what is no pose.
__attribute__((noinline)) bool ControllerSlot::isGoodToo(const Checked& c,
                                                         const double* value) noexcept {
  if (c.kind == SignalKind::Quaternion) {
    return std::abs(correction::squareOff(value)) <= correction::kUnitTolerance;
  }
  double sum = 0.0;
  for (unsigned i = 0; i < c.size; ++i) sum += value[i];
  return sum - sum == 0.0;
}

CTRL_MORE_OFTEN bool ControllerSlot::hasGoodNumbers(const double* data) const noexcept {
  if (checked_count_ == 1) return isGood(checked_, data);
  for (const Checked& c : all_checked_) {
    if (!isGood(c, data)) return false;
  }
  return true;
}

// What is wrong with the numbers it left, if anything.
FaultKind ControllerSlot::judgeNumbers(const double* data) const noexcept {
  for (const Checked& c : all_checked_) {
    const double* value = data + c.offset;
    const int size = static_cast<int>(c.size);
    if (!correction::isFinite(size, value)) return FaultKind::NotFinite;
    if (!correction::isUnit(c.kind, size, value)) return FaultKind::NotUnit;
  }
  return FaultKind::None;
}

FaultKind ControllerSlot::judgeMore(StageRun& run) noexcept {
  FaultKind kind = judgeNumbers(run.data);
  if (kind == FaultKind::None && (special_ & kLimited)) kind = judgeLimits(run);
  if (kind == FaultKind::None && run.compared && restoreUndeclared(run)) {
    kind = FaultKind::Undeclared;
  }
  return kind;
}

// Records what the controller found and left, and shows it to the next one.
CTRL_MORE_OFTEN void ControllerSlot::commit(const StageRun& run) noexcept {
  double* record = records_ + (run.buffer ? record_size_ : 0);
  if (last_ != run.buffer) last_ = run.buffer;
  *record++ = run.cycle_number;
  if (checked_count_ == 1) {
    commitSignal(checked_, run, record, total_);
    return;
  }
  for (const Checked& c : all_checked_) {
    commitSignal(c, run, record, total_);
    record += c.size;
  }
}

CTRL_MORE_OFTEN void ControllerSlot::commitSignal(const Checked& c, const StageRun& run,
                                                  double* record, std::size_t total) noexcept {
  const double* const left = run.data + c.offset;
  const double** const found = run.found + c.offset;
  if (c.kind == SignalKind::Pose) {
    recordSignal<7>(*found, left, record, total);
  } else {
    recordAny(c.size, *found, left, record, total);
  }
  *found = record + total;
}

// Puts back what was found.
void ControllerSlot::restore(const StageRun& run) const noexcept {
  for (const Written& w : written_) {
    const double* found = run.found[w.offset];
    std::copy(found, found + w.size, run.data + w.offset);
  }
}

CTRL_MORE_RARE void ControllerSlot::takeFault(StageRun& run, FaultKind kind,
                                              const char* text) noexcept {
  restore(run);
  if (run.compared) restoreUndeclared(run);
  latch(run.cycle, kind, text);
  runStopped(run);
}

// The controller called fail().
CTRL_MORE_RARE void ControllerSlot::takeFailure(StageRun& run) noexcept {
  const char* const text = controller_->failure_;
  controller_->failure_ = nullptr;
  takeFault(run, FaultKind::Declared, text);
}

// Test mode: true if something it did not declare was different, and is as before again.
bool ControllerSlot::restoreUndeclared(const StageRun& run) noexcept {
  bool changed = false;
  for (int i = 0; i < run.control.dataSize(); ++i) {
    const bool declared = i < static_cast<int>(declared_.size()) && declared_[i];
    if (declared || std::memcmp(run.data + i, run.compared + i, sizeof(double)) == 0) continue;
    run.data[i] = run.compared[i];
    changed = true;
  }
  return changed;
}

FaultKind ControllerSlot::judgeLimits(const StageRun& run) noexcept {
  bool rated = false;
  for (const Written& w : written_) {
    if (!w.limited) continue;
    double* now = now_.data() + w.local;
    correction::difference(w.kind, w.size, run.found[w.offset], run.data + w.offset, now);
    const correction::Norms n = correction::norms(w.kind, w.size, now);
    if (n.size > w.limit.size || n.angle > w.limit.angle) return FaultKind::CorrectionSize;
    if (!w.rated) continue;
    rated = true;
    double* last = raw_.data() + w.local;
    if (raw_valid_) {
      double* step = step_.data() + w.local;
      correction::difference(w.kind, w.size, last, now, step);
      const correction::Norms r = correction::norms(w.kind, w.size, step);
      const double dt = run.cycle.dt;
      if (r.size > w.limit.rate * dt || r.angle > w.limit.angle_rate * dt) {
        return FaultKind::CorrectionRate;
      }
    }
    std::copy(now, now + w.size, last);
  }
  raw_valid_ = rated;
  return FaultKind::None;
}

void ControllerSlot::blendIn(const StageRun& run) noexcept {
  for (const Written& w : written_) {
    double* c = now_.data() + w.local;
    const double* found = run.found[w.offset];
    correction::difference(w.kind, w.size, found, run.data + w.offset, c);
    correction::between(w.kind, w.size, from_.data() + w.local, c, blend_, c);
    correction::apply(w.kind, w.size, found, c, run.data + w.offset);
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

void ControllerSlot::runStopped(StageRun& run) noexcept {
  if (activity_ == Activity::Off) return;
  advanceBlend(run.cycle.dt);
  bool holding = false;
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
    correction::apply(w.kind, w.size, run.data + w.offset, c, run.data + w.offset);
  }
  commit(run);
  recordState(run);
  if (blend_ >= 1.0 && !holding && activity_ == Activity::Stopping) setActivity(Activity::Off);
  // What this took is not the next controller's.
  if (run.timed) run.boundary_ns = steadyNow();
}

// One reading of the clock per controller: the end of one is the beginning of the next.
CTRL_MORE_OFTEN bool ControllerSlot::isLate(StageRun& run) noexcept {
  const std::int64_t now = steadyNow();
  const std::int64_t duration_ns = now - run.boundary_ns;
  run.boundary_ns = now;
  last_ns_.store(duration_ns, std::memory_order_relaxed);
  if (lockstep_ || overrun_ns_ == 0) return false;
  if (duration_ns > overrun_ns_) return true;
  if (overruns_in_row_ != 0) overruns_in_row_ = 0;
  return false;
}

// What it wrote came too late: the correction of the cycle before is used again.
CTRL_MORE_RARE void ControllerSlot::overrun(StageRun& run) noexcept {
  overruns_.fetch_add(1, std::memory_order_relaxed);
  raw_valid_ = false;
  restore(run);
  lastCorrection(now_.data());
  for (const Written& w : written_) {
    double* value = run.data + w.offset;
    correction::apply(w.kind, w.size, value, now_.data() + w.local, value);
  }
  commit(run);
  if (++overruns_in_row_ >= overruns_to_pause_) {
    latch(run.cycle, FaultKind::Overrun, "update() was too slow in too many cycles in a row");
  }
}

}  // namespace ctrl_more
